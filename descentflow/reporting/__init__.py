"""How results are shown everywhere: one style of figures, one builder of HTML pages."""
