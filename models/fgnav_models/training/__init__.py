"""Making of networks: the only place with torch."""
