"""What sections are made of: diagrams, rows along the axis of time, tables and text."""
