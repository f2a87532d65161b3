"""Screening of samples, verdicts on measurements, and exclusion of an outlier."""
