"""`reach sweep`: the reachable domain over a grid of scenario values, as one result."""
