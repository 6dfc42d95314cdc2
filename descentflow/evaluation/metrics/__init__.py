"""Distances between samples and held-out flights, each beside its real-against-real floor."""
