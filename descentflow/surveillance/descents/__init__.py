"""Prepared descents: the table with its metadata, written to and read from a file or a folder."""
