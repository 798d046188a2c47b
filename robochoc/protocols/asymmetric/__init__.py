"""Protocols for asymmetric costs (ADCOP): each robot of a constraint pays its own part, and keeps it to itself."""
