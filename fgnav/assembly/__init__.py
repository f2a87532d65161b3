"""From a flight and its alignment to a smoothing problem: keyframes, motion, sensors, start."""
