"""When each facet is reachable: intervals of the time of flight, facet by facet."""
