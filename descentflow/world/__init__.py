"""Flights of known truth: a point mass flown in time by the full equation of motion."""
