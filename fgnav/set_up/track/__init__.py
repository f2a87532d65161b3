"""Inertial unit and fixes against each other, without attitudes from elsewhere."""
