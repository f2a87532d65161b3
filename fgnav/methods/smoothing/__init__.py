"""What the three ways of asking the smoother share: its solvers, sources of factors, estimates."""
