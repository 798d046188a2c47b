"""Protocols that find values that satisfy all constraints, or prove that there are none, one file each."""
