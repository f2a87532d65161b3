"""An inertial unit beside a track, in closed form by windows: which clock and which lever arm fit.

Nothing need be aligned for it: every window has a rotation of its own.
"""
