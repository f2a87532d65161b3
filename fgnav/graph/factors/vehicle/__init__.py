"""What a vehicle lets be known without an instrument: that its wheels roll, that it stands."""
