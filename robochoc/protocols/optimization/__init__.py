"""Protocols that search for the least cost and prove that it is optimal, one file each."""
