"""Vehicles as rigid bodies: what their files say, forces, air, and how they fly."""
