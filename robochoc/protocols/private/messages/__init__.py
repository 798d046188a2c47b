"""The messages of the protocols in this family."""
