"""Files in, files out: flights as folders, RINEX, SP3, estimates as CSV."""
