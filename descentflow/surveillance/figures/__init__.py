"""Figures and a page of what each filter of the cleaning kept and dropped of some flights."""
