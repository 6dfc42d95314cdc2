"""Callbacks: thin, they read the trainer, call a pure function and log the result."""
