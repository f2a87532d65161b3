"""Integer least squares (LAMBDA): decorrelation, search, success rates."""
