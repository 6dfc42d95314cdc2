"""One module for each command that is not the trainer's: its arguments and what it runs."""
