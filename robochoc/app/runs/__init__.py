"""Runs: a team in the application solves its problem in a separate process, and the outcome is saved."""
