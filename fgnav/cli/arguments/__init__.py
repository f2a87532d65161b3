"""What commands share: their options, and the methods that these ask for."""
