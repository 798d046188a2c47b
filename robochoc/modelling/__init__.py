"""Models in Python (`robochoc.Model`): a problem in a few lines, from which each robot's knowledge is derived."""
