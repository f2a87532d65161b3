"""A comparison as one page of HTML: needs no network, no server and no library to be read."""
