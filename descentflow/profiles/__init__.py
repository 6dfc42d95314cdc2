"""Drag and CAS of each flight on the flight-level grid, with the mask of what was observed."""
