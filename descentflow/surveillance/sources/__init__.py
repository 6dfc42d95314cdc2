"""One small module for each kind of file that rows come in."""
