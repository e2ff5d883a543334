"""Solvers that several missions share."""
