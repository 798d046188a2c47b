"""The protocols that are used unless another one is asked for."""

DEFAULT_PROTOCOL = "abt"
"""For a problem without costs."""
DEFAULT_COST_PROTOCOL = "sfb"
"""For a problem with costs. It also finds a minimum withdrawal where the protocol asked for cannot."""
FIRST_FIT = "first-fit"
"""It decides which robots withdraw with `--withdraw maximal`. It cannot be asked for by name."""


def default_protocol(kind: str) -> str:
    """Return the name of the protocol for a problem of this `ProblemKind`."""
    return DEFAULT_PROTOCOL if kind == "DisCSP" else DEFAULT_COST_PROTOCOL
