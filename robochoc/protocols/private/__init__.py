"""Private optimisation: protocols that hide more information than the constraints that robots do not share."""
