"""Protocols that allocate tasks, each to one robot at most, by bids for them: one file each."""
