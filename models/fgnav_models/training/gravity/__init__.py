"""Training of the gravity networks."""
