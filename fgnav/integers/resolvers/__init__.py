"""Resolvers of integers, by name, and how a flight is resolved by one."""
