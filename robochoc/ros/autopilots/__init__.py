"""Vehicles whose autopilots speak MAVLink, such as PX4: decisions are flown, and telemetry becomes reports."""
