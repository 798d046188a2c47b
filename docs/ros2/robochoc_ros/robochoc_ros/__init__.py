"""Launch files for robochoc: nothing is imported from here."""
