"""What the slip test says of a step of phase on one baseline and channel."""

# Of tied channels two slipped, but not to be told which.
NOT_TESTED, FINE, SLIP, TIED = range(4)
