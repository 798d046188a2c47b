"""Make domains arc consistent before the protocol that was asked for begins (`--preprocess ac`).

It is a search of its own, whose findings are the values that are left. The team of the search that follows is the same
with these values only: so journals and replays of it need nothing else. The answer is checked with the files.

Where the problem changes, it is done anew before each epoch, from the domains of the files. Deletions that rest on what
is gone come back that way, and to a protocol that goes on they are values that a change has added.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import reduce
from operator import add

from robochoc.model.outcome import Preprocessing
from robochoc.model.problem import Domain, Robot, Team
from robochoc.protocols.findings import Findings
from robochoc.run.defaults import PREPROCESSING
from robochoc.run.options import Options
from robochoc.run.phases import RunPhase
from robochoc.run.registry import protocol_or_stage
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compiled_team import CompiledTeam


def preprocessing_phase(options: Options) -> RunPhase:
    """Return the search before that of the protocol."""
    return RunPhase(PREPROCESSING, protocol_or_stage(PREPROCESSING), RunParameters(options.seed))


def removed_values(compiled: CompiledTeam, findings: Mapping[str, Findings]) -> int:
    """Return how many values of the robots are not left."""
    return sum(
        len(robot.domain.values) - len(findings[name].left or ())
        for name, robot in compiled.robots.items()
        if name in findings
    )


def total_preprocessing(done: Sequence[Preprocessing]) -> Preprocessing | None:
    """Return the sum of what was done before the epochs of a run; None if that is nothing."""
    if not done:
        return None
    spent = reduce(add, [one.metrics for one in done])
    return Preprocessing(done[0].name, spent, sum(one.removed for one in done), sum(one.values for one in done))


def restricted(compiled: CompiledTeam, findings: Mapping[str, Findings]) -> Team:
    """Return the team whose robots show only values that are left.

    A value of a robot with several variables is a combination of theirs. There each variable keeps what it has in one
    of the combinations left: that may be more of them, and never fewer.
    """
    robots = []
    for robot in compiled.team.robots:
        values = compiled[robot.name].values
        left = findings[robot.name].left or ()
        columns = zip(*(values[place] for place in left), strict=True)
        kept = {name: frozenset(column) for name, column in zip(robot.interface, columns, strict=False)}
        robots.append(_with_values(robot, kept) if len(left) < len(values) else robot)
    return replace(compiled.team, robots=tuple(robots))


def _with_values(robot: Robot, kept: Mapping[str, Collection[int]]) -> Robot:
    """Return `robot` with those of its variables' values that are `kept`."""
    variables = tuple(
        replace(one, domain=_only(one.domain, kept[one.name])) if one.name in kept else one for one in robot.variables
    )
    return replace(robot, variables=variables)


def _only(domain: Domain, kept: Collection[int]) -> Domain:
    """Return `domain` with the values `kept`, in its order."""
    ranges: list[range] = []
    for value in domain:
        if value in kept:
            if ranges and ranges[-1].stop == value:
                ranges[-1] = range(ranges[-1].start, value + 1)
            else:
                ranges.append(range(value, value + 1))
    return replace(domain, ranges=tuple(ranges))
