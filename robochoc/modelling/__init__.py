"""Models in Python: a problem in a few lines, from which the robots' knowledge follows (`robochoc.Model`)."""
