"""Sealed studies of the diagnosis: effects hidden in flights of the world, found or not, and scored after the seal."""
