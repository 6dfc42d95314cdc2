"""The version of the package; kept here, at the bottom, so that what writes it need not import the front door."""

__version__ = "0.2.0"
