"""Protocols that allocate tasks, each to at most one robot, by bids, one file each."""
