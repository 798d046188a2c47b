"""The settings of the protocols in this family."""
