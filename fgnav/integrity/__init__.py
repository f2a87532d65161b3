"""What contradicts: samples screened before, verdicts after, and the exclusion of a suspect."""
