"""Figures about aircraft types and the energy equation, for the documentation."""
