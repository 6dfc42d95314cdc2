"""Figures that only the study of blind diagnosis draws."""
