"""How the spacecraft flies to one site, clear of the terrain, with the least fuel."""
