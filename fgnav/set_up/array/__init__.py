"""Inertial unit and detector against the attitudes of an antenna array."""
