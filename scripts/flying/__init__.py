"""Flights of other people's simulators: how real flights began, who flies them on, and what a radar would report."""
