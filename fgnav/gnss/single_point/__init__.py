"""Position and velocity of one antenna from its own code and Doppler."""
