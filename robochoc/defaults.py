"""What solves a team, unless something else is asked for."""

SATISFIES = "abt"
"""A team without costs."""
MINIMISES = "sfb"
"""One with costs; it also says who steps aside, when the protocol that was asked for cannot."""
