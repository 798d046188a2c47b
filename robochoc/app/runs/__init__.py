"""Runs: a team of the application decides, in a process of its own, and what came of it is kept."""
