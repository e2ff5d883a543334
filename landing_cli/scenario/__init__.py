"""A scenario file: read, checked, and turned into bodies and spacecraft."""
