"""Options that commands share, and the methods that these ask for."""
