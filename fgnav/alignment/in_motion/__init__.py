"""Attitudes by motion beside a gyroscope: specific forces known in two frames."""
