"""What each cleaning rule kept and dropped of some flights, as figures and a page."""
