"""Checks of answers, independent of the protocols that have found them."""
