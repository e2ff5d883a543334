"""The asteroids that a spare spacecraft can fly by on its way (Liu 2023)."""
