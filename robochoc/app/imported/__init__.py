"""Imported teams, which were not drawn in the application: facts from their files, in words and as a picture."""
