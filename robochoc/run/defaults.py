"""The protocols that are used unless another one is asked for."""

AUTO = "auto"
"""Requests that a protocol is chosen for the team (`run/choice.py`). No protocol has this name."""
DEFAULT_PROTOCOL = "abt"
"""For a problem without costs of which nothing else is known."""
DEFAULT_COST_PROTOCOL = "sfb"
"""For a problem with costs, likewise. It also finds a minimum withdrawal where the protocol asked for cannot."""
PREPROCESSING = "ac"
"""It makes domains arc consistent before the protocol, with `--preprocess ac`. It cannot be asked for by name."""
FIRST_FIT = "first-fit"
"""It decides which robots withdraw with `--withdraw maximal`. It cannot be asked for by name."""
MOST_LOSS = 0.9
"""The largest probability of the loss of a message. With more, next to nothing arrives."""
