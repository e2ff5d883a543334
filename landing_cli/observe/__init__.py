"""`plan observe`: landings bent towards the landmarks that they navigate by."""
