"""Lightning callbacks: each reads the trainer, calls a pure function and logs what it returns."""
