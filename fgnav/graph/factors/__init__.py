"""One file for each sensor: residual, Jacobian, noise, GTSAM form, and its name in reports."""
