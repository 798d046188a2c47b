"""What solves a team, unless something else is asked for."""

DEFAULT_PROTOCOL = "abt"
"""A team without costs."""
DEFAULT_COST_PROTOCOL = "sfb"
"""One with costs; it also says who steps aside, when the protocol that was asked for cannot."""
FIRST_FIT = "first-fit"
"""Says who steps aside with `--withdraw maximal`. Nobody can ask for it by name."""


def default_protocol(kind: str) -> str:
    """The protocol for a team of this `Kind`."""
    return DEFAULT_PROTOCOL if kind == "DisCSP" else DEFAULT_COST_PROTOCOL
