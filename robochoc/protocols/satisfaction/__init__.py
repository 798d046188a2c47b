"""Protocols that find values that satisfy every constraint, or prove that there are none: one file each."""
