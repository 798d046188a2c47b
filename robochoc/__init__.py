"""robochoc: teams of robots that solve constraint problems together."""

__version__ = "0.1.0"
