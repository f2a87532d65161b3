"""What a flight says of its array's set-up: places of antennas, and the turn of all of them."""
