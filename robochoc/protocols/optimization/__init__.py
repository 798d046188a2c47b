"""Protocols that search for the least cost, and prove it: one file each."""
