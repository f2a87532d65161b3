"""What a flight says of itself without truth: residuals, filter against smoother, Allan deviation.

Each file has one equation; none knows how it is drawn.
"""
