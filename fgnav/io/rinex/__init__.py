"""RINEX files: checked, read and written."""
