"""Released weights, verified and run; neither torch nor the simulator."""
