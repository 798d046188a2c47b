"""Simulated quadrotors: bodies, motors, control, wind, and what they meet. `robochoc.flight.flight` flies them."""
