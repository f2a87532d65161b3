"""What innovations may be: the band of their number, and those that single epochs do not show."""
