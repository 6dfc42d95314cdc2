"""From surveillance rows to cleaned free descents; this part never imports torch."""
