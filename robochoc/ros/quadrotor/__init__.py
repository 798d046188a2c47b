"""Simulated quadrotors: bodies, motors, control, wind, and what they meet. `robochoc.ros.flight` flies them."""
