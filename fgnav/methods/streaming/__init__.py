"""What comes to a stream, and how a keyframe of it is put to the window."""
