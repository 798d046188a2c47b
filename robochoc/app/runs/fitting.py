"""The protocols that are suitable for a team, and the choice of `auto` with its reasons."""

from __future__ import annotations

import msgspec

from robochoc.app.runs.prepared_team import TeamFiles
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.checks import errors_of
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.sketch.troubles import NotReadyError
from robochoc.formats import read_team
from robochoc.model.problem import Team
from robochoc.run.choice import accepts
from robochoc.run.facts import Facts
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import prepare
from robochoc.run.registry import installed_protocols


class Fitting(msgspec.Struct, frozen=True):
    """The protocols that are suitable for a team.

    Attributes:
        protocols: The protocols that accept the team, complete ones first, each with whether it is complete.
        costs: Whether the team has costs.
        chosen: The protocol that `auto` chooses.
        why: The reason for the choice, in words.
        facts: Facts about the team, in words.
        rejected: The reasons for rejecting better known protocols, by name.
    """

    protocols: tuple[tuple[str, bool], ...]
    costs: bool
    chosen: str
    why: str
    facts: tuple[str, ...]
    rejected: tuple[tuple[str, str], ...]


def team_of(sketch: Sketch, files: TeamFiles | None = None) -> Team:
    """Return the team given by files, or by a sketch if there are no files.

    Raises:
        NotReadyError: if the sketch is incomplete.
        InvalidInputError: if the files are damaged.
    """
    if files:
        return read_team(files.folder)
    for trouble in errors_of(sketch):
        raise NotReadyError(trouble)
    return model_of(sketch).team


def fitting_protocols(team: Team, options: Options) -> tuple[tuple[str, bool], ...]:
    """Return the protocols that accept a team, complete ones first, each with whether it is complete."""
    traits = {one.name: one.protocol.traits for one in installed_protocols() if one.protocol}
    solved = prepare(team, options).team if team.objectives else team
    known = [(name, one.complete) for name, one in traits.items() if one.fronts or not team.objectives]
    fit = [(name, complete) for name, complete in known if accepts(name, solved, options)]
    return tuple(sorted(fit, key=lambda one: (not one[1], one[0])))


def fitting(sketch: Sketch, files: TeamFiles | None = None, runtime: str = Runtime.SIMULATOR) -> Fitting:
    """Return the protocols that are suitable for the team given by a sketch or by files.

    Raises:
        NotReadyError: if the sketch is incomplete.
        UnsupportedError: if no protocol can solve the team's problem.
        InvalidInputError: if the files are damaged.
    """
    team = team_of(sketch, files)
    options = Options(runtime=Runtime(runtime))
    choice = prepare(team, options).choice
    return Fitting(
        protocols=fitting_protocols(team, options),
        costs=Facts(team).has_costs,
        chosen=choice.options.protocol,
        why=choice.options.chosen.get("protocol", ""),
        facts=choice.facts,
        rejected=choice.rejected,
    )
