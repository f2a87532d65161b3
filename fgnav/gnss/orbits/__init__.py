"""Where satellites are and how their clocks stand, by messages or by tables."""
