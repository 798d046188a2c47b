"""The commands of `robochoc`, one module each."""
