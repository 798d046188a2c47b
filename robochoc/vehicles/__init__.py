"""Vehicles with their own autopilots, by MAVLink or cflib: flies decisions, and converts telemetry to reports."""
