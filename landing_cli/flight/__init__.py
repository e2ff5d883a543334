"""The spacecraft near the asteroid: dynamics, trajectories and re-flight."""
