"""`reach rank`: landing sites of a reach run in order of a stated score."""
