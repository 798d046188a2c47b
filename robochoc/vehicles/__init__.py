"""Vehicles with autopilots of their own, by MAVLink or cflib: decisions are flown, and telemetry becomes reports."""
