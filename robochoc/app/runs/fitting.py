"""Which protocols fit a team, and why `auto` chooses the one that it does."""

from __future__ import annotations

import msgspec

from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.sketch import Sketch
from robochoc.run.choice import accepts, decided
from robochoc.run.options import Options, Runtime
from robochoc.run.registry import installed_protocols


class Fitting(msgspec.Struct, frozen=True):
    """What fits a team.

    Attributes:
        protocols: The protocols that accept it, complete ones first, and whether each is complete.
        chosen: The one that `auto` takes.
        why: Why, in words.
        facts: What is known of the team, in words.
        rejected: Why better known ones were not taken, by name.
    """

    protocols: tuple[tuple[str, bool], ...]
    chosen: str
    why: str
    facts: tuple[str, ...]
    rejected: tuple[tuple[str, str], ...]


def fitting(sketch: Sketch, runtime: str = Runtime.SIMULATOR) -> Fitting:
    """Return what fits a team. Raises `ModelError`, or `UnsupportedError`, for a team that nothing can decide."""
    team = model_of(sketch).team
    options = Options(runtime=Runtime(runtime))
    known = [(one.name, one.protocol.traits.complete) for one in installed_protocols() if one.protocol]
    fit = [(name, complete) for name, complete in known if accepts(name, team, options)]
    choice = decided(team, options)
    return Fitting(
        protocols=tuple(sorted(fit, key=lambda one: (not one[1], one[0]))),
        chosen=choice.options.protocol,
        why=choice.options.chosen.get("protocol", ""),
        facts=choice.facts,
        rejected=choice.rejected,
    )
