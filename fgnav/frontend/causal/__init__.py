"""The front end of a filter: every quantity from epochs up to its own alone."""
