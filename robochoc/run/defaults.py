"""Names of protocols with a special meaning, and the defaults."""

AUTO = "auto"
"""Requests the choice of a protocol for the team (`run/choice.py`). No protocol has this name."""
CENTRAL = "central"
"""The central solver, which decides one model of all files. It is not a protocol."""
DEFAULT_PROTOCOL = "abt"
"""The default protocol for a problem without costs."""
DEFAULT_COST_PROTOCOL = "sfb"
"""The default protocol for a problem with costs. It also finds a minimum withdrawal if the chosen protocol cannot."""
FRONT_PROTOCOL = "mo-dpop"
"""The protocol that finds the Pareto front of several objectives, unless another one is chosen."""
PREPROCESSING = "ac"
"""The protocol of `--preprocess ac`, which makes domains arc consistent. Users cannot choose it by name."""
REPAIR = "gdba"
"""The protocol that repairs an assignment that violates hard constraints (`run/phases.py`)."""
FIRST_FIT = "first-fit"
"""The protocol of `--withdraw maximal`, which decides which robots withdraw. Users cannot choose it by name."""
ROUNDS = "rounds"
"""The messages of games in rounds (`robochoc play`), in journals. Users cannot choose it by name."""
MOST_LOSS = 0.9
"""The largest allowed probability of message loss. Above it, hardly any message arrives."""
MASTER = "MASTER"
"""The name of the first master of a run on a network."""
MOST_STANDBYS = 9
"""The maximum number of standby masters on this machine."""


def standby_names(number: int) -> tuple[str, ...]:
    """Return the names of `number` standby masters on this machine."""
    return tuple(f"STANDBY{place}" for place in range(1, number + 1))
