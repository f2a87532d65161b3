"""Motion between keyframes: preintegrated gyroscope, or a prior of the rate and specific force."""
