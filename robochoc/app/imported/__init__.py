"""Imported teams, which were not drawn in the application: facts about their files, in words and as a picture."""
