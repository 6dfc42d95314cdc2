"""What each filter of the cleaning kept and dropped of some flights, as figures and a page."""
