"""A comparison as people read it: a table on screen, a figure in a file."""
