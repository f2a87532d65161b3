"""Arcs of continuous carrier phase, and the cycle slips that end them."""
