"""Noises of a flight by the greatest likelihood of its linearised chain, or as it states them."""
