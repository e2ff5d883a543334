"""Physical constants that scenarios need."""

GRAVITATIONAL_CONSTANT = 6.67430e-11  # m3/(kg s2), CODATA 2018
