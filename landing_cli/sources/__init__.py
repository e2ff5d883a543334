"""What comes from outside, read strictly and checked."""
