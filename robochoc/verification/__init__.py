"""Checks of answers, which share nothing with the protocols that found them."""
