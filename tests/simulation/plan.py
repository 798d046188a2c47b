"""A plan: everything that a seed decides about one simulated run, and how to make it smaller."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from typing import Any, NamedTuple

from robochoc.communication.kill_schedule import Kill
from robochoc.model.change import apply_changes
from robochoc.model.problem import RemoveConstraint, RemoveValue, Robot, Team
from robochoc.model.team_edits import without_robots
from robochoc.run import Options, Runtime


class FaultKind(StrEnum):
    """A kind of fault.

    `CLOCK`: the clock jumps by `for_s`. `DISK`: the disk of the journal is full after `size` bytes. `CRASH`: the
    robot's process ends. `STOP`: it stands still for `for_s` seconds. `SLOW`: each of its steps lasts `for_s` seconds.
    `PARTITION`: what the robot sends to others, or they to it, arrives only after `for_s` seconds. `GARBLE`: its
    message number `size` cannot be decoded. `LOSS`: the network loses its next `size` frames. `LIE`: it is a traitor,
    with the lie number `size`. `REVOKE`: the Authority revokes its name.
    """

    CLOCK = "clock"
    DISK = "disk"
    CRASH = "crash"
    STOP = "stop"
    SLOW = "slow"
    PARTITION = "partition"
    GARBLE = "garble"
    LOSS = "loss"
    LIE = "lie"
    REVOKE = "revoke"


class Fault(NamedTuple):
    """A fault that happens `at_s` seconds after the start of the run."""

    kind: FaultKind
    robot: str = ""
    at_s: float = 0.0
    for_s: float = 0.0
    size: int = 0

    def __str__(self) -> str:
        return f"{self.kind} {self.robot} at {self.at_s:g} s for {self.for_s:g} s, {self.size}"


class Reduction(NamedTuple):
    """Something left out of a plan: a fault, an option, a setting, an event, a robot, a constraint or a value."""

    what: str
    which: str
    number: int = 0

    def __str__(self) -> str:
        return f"{self.what} {self.which} {self.number}"


@dataclass(frozen=True)
class Plan:
    """One run.

    Attributes:
        tick_s: The virtual seconds that pass with each look at the clock.
        delay_s: The longest delay of a message.
        environment: True if an environment returns the events of the scenario, one after each answer.
        private: True if robots do not disclose their values to the master.
    """

    seed: int
    team: Team
    options: Options
    faults: tuple[Fault, ...] = ()
    tick_s: float = 1e-3
    delay_s: float = 0.0
    environment: bool = False
    private: bool = False
    reductions: tuple[Reduction, ...] = ()

    def has(self, *kinds: FaultKind) -> bool:
        """Return whether the plan has a fault of one of these kinds."""
        return any(fault.kind in kinds for fault in self.faults)


def changed_options(options: Options) -> dict[str, object]:
    """Return the options that differ from the defaults, by name."""
    usual = Options()
    given = {one.name: getattr(options, one.name) for one in fields(options)}
    return {name: value for name, value in given.items() if value != getattr(usual, name)}


FIXED = frozenset({"protocol", "runtime", "seed", "cache"})
"""Options without which the run would be another one."""


FLAGS = ("environment", "private")
"""Attributes of a plan that are usually false."""


def possible_reductions(plan: Plan) -> Iterator[Reduction]:
    """Yield everything that can be left out, large parts first."""
    for number, _ in reversed([*enumerate(plan.faults)]):
        yield Reduction("fault", "", number)
    for name in FLAGS:
        if getattr(plan, name):
            yield Reduction("flag", name)
    for number, _ in reversed([*enumerate(plan.team.scenario)]):
        yield Reduction("event", "", number)
    for name in changed_options(plan.options).keys() - FIXED - {"settings"}:
        yield Reduction("option", name)
    for name in plan.options.settings:
        yield Reduction("setting", name)
    yield from _reductions_of_team(plan.team)


def _reductions_of_team(team: Team) -> Iterator[Reduction]:
    for name in reversed(team.order):
        yield Reduction("robot", name)
    for robot in team.robots:
        for parent in robot.parents:
            for name, times in Counter(one.name for one in parent.constraints).items():
                if times == 1:
                    yield Reduction("constraint", f"{robot.name} {parent.name} {name}")
        for number, _ in reversed([*enumerate(robot.private)]):
            yield Reduction("private", robot.name, number)
    for name, variable in team.variables.items():
        for value in variable.domain:
            yield Reduction("value", name, value)


def reduced(plan: Plan, reduction: Reduction) -> Plan:
    """Return `plan` without what `reduction` names. The team may be invalid then; raises `ChangeError`."""
    what, which, number = reduction
    team, options, faults = plan.team, plan.options, plan.faults
    match what:
        case "fault":
            faults = (*faults[:number], *faults[number + 1 :])
        case "event":
            team = replace(team, scenario=(*team.scenario[:number], *team.scenario[number + 1 :]))
        case "flag":
            changed: dict[str, Any] = {which: False}
            plan = replace(plan, **changed)
        case "option":
            options = replace(options, **{which: getattr(Options(), which)})
        case "setting":
            left = {name: value for name, value in options.settings.items() if name != which}
            options = replace(options, settings=left)
        case "robot":
            team, options = without_robots(team, [which]), _without_robot(options, which)
            faults = tuple(fault for fault in faults if fault.robot != which)
        case "constraint":
            team = apply_changes(team, [RemoveConstraint(*which.split())])
        case "private":
            team = _with_robot(team, _without_private(team[which], number))
        case _:
            team = apply_changes(team, [RemoveValue(which, number)])
    return replace(plan, team=team, options=options, faults=faults, reductions=(*plan.reductions, reduction))


def _without_robot(options: Options, name: str) -> Options:
    kills = tuple(kill for kill in options.kill if Kill(*kill).robot != name)
    order = options.order
    if isinstance(order, tuple):
        order = tuple(one for one in order if one != name)
    return replace(options, kill=kills, order=order)


def _without_private(robot: Robot, number: int) -> Robot:
    return replace(robot, private=(*robot.private[:number], *robot.private[number + 1 :]))


def _with_robot(team: Team, robot: Robot) -> Team:
    return replace(team, robots=tuple(robot if one.name == robot.name else one for one in team.robots))


def described(plan: Plan) -> dict[str, object]:
    """Return what a reader needs to know of a plan, as JSON types."""
    options = {name: _shown(value) for name, value in changed_options(plan.options).items()}
    team = {
        robot.name: {
            "values": {one.name: [*one.domain] for one in robot.variables},
            "constraints": [_constraint(one) for one in robot.constraints()],
        }
        for robot in plan.team.robots
    }
    return {
        "runtime": str(plan.options.runtime or Runtime.PROCESSES),
        "options": options,
        "faults": [str(fault) for fault in plan.faults],
        **{name: True for name in FLAGS if getattr(plan, name)},
        "tick_s": plan.tick_s,
        "delay_s": plan.delay_s,
        "team": team,
        "scenario": [str(event) for event in plan.team.scenario],
    }


def _constraint(constraint: object) -> str:
    name, variables = getattr(constraint, "name", ""), getattr(constraint, "variables", ())
    return f"{name}({', '.join(variables)}): {getattr(constraint, 'definition', '')}"


def _shown(value: object) -> object:
    return value if isinstance(value, int | float | str) else str(value)
