"""From a flight to a smoothing problem: keyframes, alignment, fault detection, measurements."""
