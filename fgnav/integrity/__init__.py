"""What contradicts: verdicts on sensors by their innovations, and the exclusion of a suspect."""
