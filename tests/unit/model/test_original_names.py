"""Results of imported problems have the original names everywhere."""

from __future__ import annotations

from dataclasses import asdict
from random import Random

from robochoc.model.original_names import renamed_outcome
from tests.support.random_outcomes import NAMES, VARIABLES, random_outcome

TEXTS = {"team", "protocol", "runtime", "reason", "order", "channel", "placed_by", "chosen", "name", "confirmed_by"}
TEXTS |= {"solved_by", "stages", "repair", "led_by", "value", "method"}
"""Fields whose texts are not names of robots and variables."""
COUNTED = {"messages", "symbols", "objectives"}
"""Fields whose keys are types of messages, or names of symbols or objectives."""


def names_in(found: object) -> set[str]:
    """Return all texts in the fields of an outcome that hold names."""
    if isinstance(found, str):
        return {found}
    if hasattr(found, "_asdict"):
        found = found._asdict()
    if isinstance(found, dict):
        parts = [(key, value) for key, value in found.items() if key not in TEXTS | COUNTED | {"verdict", "opened_by"}]
        return {str(key) for key, _ in parts}.union(*(names_in(value) for _, value in parts))
    return set().union(*map(names_in, found)) if isinstance(found, list | tuple) else set()


def test_no_name_is_left_out() -> None:
    chance = Random(3)
    names = {name: f"{name}!" for name in {*NAMES, *VARIABLES}}
    for _ in range(100):
        outcome = random_outcome(chance)
        assert names_in(asdict(outcome)) & names.keys()
        assert not names_in(asdict(renamed_outcome(outcome, names))) & names.keys()
