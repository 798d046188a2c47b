"""Sketches: teams as drawn by the user, with their edits, checks, files and conversions. NiceGUI is not used here."""
