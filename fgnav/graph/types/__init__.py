"""What a smoothing problem is made of, and what solving it yields."""
