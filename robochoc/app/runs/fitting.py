"""Which protocols fit a team, and why `auto` chooses the one that it does."""

from __future__ import annotations

import msgspec

from robochoc.app.runs.prepared import TeamFiles
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.checks import errors_of
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.sketch.troubles import NotReadyError
from robochoc.formats import read_team
from robochoc.model.problem import Team
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


def team_of(sketch: Sketch, files: TeamFiles | None = None) -> Team:
    """Return the team of a sketch, or that of files where there are some.

    Raises:
        NotReadyError: for a sketch that is no team yet.
        InvalidInputError: if the files are damaged.
    """
    if files:
        return read_team(files.folder)
    for trouble in errors_of(sketch):
        raise NotReadyError(trouble)
    return model_of(sketch).team


def fitting_protocols(team: Team, options: Options) -> tuple[tuple[str, bool], ...]:
    """Return the protocols that accept a team, complete ones first, and whether each is complete."""
    known = [(one.name, one.protocol.traits.complete) for one in installed_protocols() if one.protocol]
    fit = [(name, complete) for name, complete in known if accepts(name, team, options)]
    return tuple(sorted(fit, key=lambda one: (not one[1], one[0])))


def fitting(sketch: Sketch, files: TeamFiles | None = None, runtime: str = Runtime.SIMULATOR) -> Fitting:
    """Return what fits the team of a sketch, or of files.

    Raises:
        NotReadyError: for a sketch that is no team yet.
        UnsupportedError: for a team that nothing can decide.
        InvalidInputError: if the files are damaged.
    """
    team = team_of(sketch, files)
    options = Options(runtime=Runtime(runtime))
    choice = decided(team, options)
    return Fitting(
        protocols=fitting_protocols(team, options),
        chosen=choice.options.protocol,
        why=choice.options.chosen.get("protocol", ""),
        facts=choice.facts,
        rejected=choice.rejected,
    )
