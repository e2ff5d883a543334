"""The asteroid: its surface, its gravity, and the distance to it, as arrays."""
