"""Where on the asteroid the spacecraft can land: the reachable domain."""
