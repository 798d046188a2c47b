"""Sketches: teams drawn by the user, with edits, checks, files and conversions. NiceGUI is not used here."""
