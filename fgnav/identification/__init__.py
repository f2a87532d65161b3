"""What a flight does not state of its sensors, identified from it: noise, walks, delays, clocks.

One marginal likelihood of the whole chain, linearised (docs/model.md, "Noise identification").
"""
