"""The antenna array's phases: which integers and links agree, and the attitude by them."""
