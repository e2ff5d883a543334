"""How surely each facet is reachable, when the start is not known exactly."""
