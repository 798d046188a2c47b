"""The largest team that this machine solves in a given time: grown problems, measured steps, and their limits."""
