"""One file, one section of a page: what it shows and how."""
