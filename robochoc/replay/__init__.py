"""Replay: what a journal holds, played again with the same protocol objects."""
