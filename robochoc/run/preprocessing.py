"""Make domains arc consistent before the chosen protocol starts (`--preprocess ac`).

The preprocessing is a separate search, whose findings are the remaining values. The main search uses the same team with
only these values, so its journals and replays need no further data. The answer is checked against the files.

If the problem changes, the preprocessing is repeated before each epoch, from the domains in the files. So a removed
value returns when the reason for its removal no longer exists; a protocol that continues treats this value like one
that a change has added.
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
    """Return the preprocessing phase."""
    return RunPhase(PREPROCESSING, protocol_or_stage(PREPROCESSING), RunParameters(options.seed))


def removed_values(compiled: CompiledTeam, findings: Mapping[str, Findings]) -> int:
    """Return the number of values that the preprocessing removed from all robots' domains."""
    return sum(
        len(robot.domain.values) - len(findings[name].left or ())
        for name, robot in compiled.robots.items()
        if name in findings
    )


def total_preprocessing(done: Sequence[Preprocessing]) -> Preprocessing | None:
    """Return the total preprocessing in all epochs of a run, or None if there was no preprocessing."""
    if not done:
        return None
    spent = reduce(add, [one.metrics for one in done])
    return Preprocessing(done[0].name, spent, sum(one.removed for one in done), sum(one.values for one in done))


def restricted(compiled: CompiledTeam, findings: Mapping[str, Findings]) -> Team:
    """Return the team with only the remaining values.

    A value of a robot with several variables is a combination of their values. Each variable keeps the values that
    occur in the remaining combinations. So the returned team may have more combinations than remain, but never fewer.
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
    """Return `robot` with the domains of its variables restricted to the values `kept`."""
    variables = tuple(
        replace(one, domain=_only(one.domain, kept[one.name])) if one.name in kept else one for one in robot.variables
    )
    return replace(robot, variables=variables)


def _only(domain: Domain, kept: Collection[int]) -> Domain:
    """Return `domain` restricted to the values `kept`, in the original order."""
    ranges: list[range] = []
    for value in domain:
        if value in kept:
            if ranges and ranges[-1].stop == value:
                ranges[-1] = range(ranges[-1].start, value + 1)
            else:
                ranges.append(range(value, value + 1))
    return replace(domain, ranges=tuple(ranges))
