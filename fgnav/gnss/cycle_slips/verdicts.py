"""What the slip test says of a step of phase on one baseline and channel."""

NOT_TESTED, FINE, SLIP = range(3)
