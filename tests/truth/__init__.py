"""The independent truth: scripts that make it, and tables that tests read."""
