"""Functions that return a matplotlib Figure; none of them reads or writes a file."""
