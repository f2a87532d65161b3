"""Training: the only place with torch."""
