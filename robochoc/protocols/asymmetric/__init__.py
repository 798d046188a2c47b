"""Protocols for asymmetric costs (ADCOP): each robot in a constraint pays its own part, and keeps it private."""
