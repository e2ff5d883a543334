"""Gravity fields of a small body, as compiled kernels behind one record."""
