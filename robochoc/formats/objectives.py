"""Rules for teams with several objectives (docs/reference/format.md, "Several objectives").

A robot lists the objectives of its team, and each of its costs belongs to one of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from robochoc.formats.diagnostics import Diagnostic, MistakeError, shortened, suggestion
from robochoc.formats.names import is_name
from robochoc.formats.team_members import TeamMembers
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import Constraint, ProblemKind

FEWEST, MOST = 2, 3
"""The minimum and maximum number of objectives of a team that has several."""


def check_objectives(names: Sequence[str], kind: ProblemKind, units: CostUnits) -> None:
    """Raise `MistakeError` unless `names` are valid objectives of a robot. No names: the team has a single cost."""
    if not names:
        return
    if kind != ProblemKind.DISWCSP:
        raise MistakeError("a DisCSP cannot have objectives", 'write type="DisWCSP" in the presentation')
    for name in names:
        if not is_name(name):
            hint = "write a letter, then letters, digits, '.' and '_'"
            raise MistakeError(f"'{shortened(name)}' cannot be the name of an objective", hint)
    if not FEWEST <= len(names) <= MOST:
        many = "1 objective is" if len(names) == 1 else f"{len(names):,} objectives are"
        raise MistakeError(f"{many} listed", f"list {FEWEST} or {MOST}, or none if there is a single cost")
    if len({*names}) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise MistakeError(f"the objective '{shortened(twice)}' is listed twice", "list each objective once")
    if units.constant:
        raise MistakeError("the constant of the costs belongs to no objective", "delete it")


def check_objective(constraint: Constraint, names: Sequence[str]) -> None:
    """Raise `MistakeError` unless the costs of `constraint` belong to one of the robot's objectives `names`."""
    objective = constraint.objective
    if objective and not names:
        hint = f'write objectives="{shortened(objective)} ..." in the presentation, or delete the objective'
        raise MistakeError(f"the objective '{shortened(objective)}' is not listed in the presentation", hint)
    if objective and objective not in names:
        hint = suggestion(objective, names, "objectives")
        raise MistakeError(f"unknown objective '{shortened(objective)}'", hint)
    if names and constraint.has_costs and not objective:
        hint = " or ".join(f'objective="{name}"' for name in names)
        raise MistakeError("the costs of the constraint belong to no objective", f"write {hint}")
    if objective and not constraint.has_costs:
        raise MistakeError("a hard constraint cannot have an objective", "delete it: only costs belong to an objective")


def mixed_objectives(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield robots whose objectives differ from those of the first robot."""
    robots = [*members.robots]
    for robot in robots:
        if robot.objectives != robots[0].objectives:
            here, there = _in_words(robot.objectives), _in_words(robots[0].objectives)
            message = f"the robot has {here}, but '{robots[0].name}' has {there}"
            hint = f"list the same objectives in the same order here and at {members.place(robots[0].name)}"
            yield members.place(robot.name).mistake(message, hint)


def _in_words(names: Sequence[str]) -> str:
    return f"the objectives {shortened(' '.join(names))}" if names else "no objectives"
