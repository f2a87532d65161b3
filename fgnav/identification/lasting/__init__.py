"""What is off for a whole flight, and shows in no epoch: a landmark, a detector, a unit's axes."""
