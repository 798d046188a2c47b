"""Checks of answers, independent of the protocols that found the answers."""
