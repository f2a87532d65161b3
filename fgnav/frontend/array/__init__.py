"""The antenna array's phases: which integers and links agree, and what they say."""
