"""Families of problems, one file each."""
