"""The pages of imported teams that differ from those of teams that were drawn here."""
