"""Private optimisation: protocols that hide more from robots than the constraints that they do not share."""
