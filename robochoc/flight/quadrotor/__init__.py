"""Simulated quadrotors: rigid bodies, motors, control, wind and obstacles. `robochoc.flight.flight` flies them."""
