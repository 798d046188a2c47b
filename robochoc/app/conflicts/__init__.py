"""Conflicts: minimal sets of rules that cannot be satisfied together. This package does not use NiceGUI."""
