"""Constraints of a vehicle: rolling wheels, standstill, aerodynamic angles."""
