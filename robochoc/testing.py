"""Tools for tests of protocols: protocol objects without a runtime, schedules of messages, and checks.

>>> import robochoc
>>> from robochoc.protocols.satisfaction.abt import ABT
>>> from robochoc.testing import deliver, protocol_objects, start
>>> model = robochoc.Model()
>>> x = [model.robot(f"r{i}").variable("x", range(2)) for i in range(2)]
>>> rule = model.add(x[0] != x[1])
>>> robots = protocol_objects(model.team, ABT)
>>> start(robots)
>>> [(sender, receiver, type(message).__name__) for sender, receiver, message in deliver(robots)]
[('r0', 'r1', 'Ok')]
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from typing import TypeVar

from robochoc.communication.simulator.schedule import Concurrent, RandomChannels, Schedule
from robochoc.communication.simulator.simulator import Simulation
from robochoc.exploration.changes import FaultPlan
from robochoc.exploration.check import CheckOptions, cases_of, checked
from robochoc.exploration.conformance import fault_in_simulation
from robochoc.exploration.problems import small_teams
from robochoc.exploration.shrinking import reduced
from robochoc.model.problem import Team
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.run.options import Options, Runtime
from robochoc.run.registry import class_fault
from robochoc.solver.agent_problem import agent_problems
from robochoc.solver.local_problem import LocalProblem
from robochoc.verification.checker import violations

__all__ = [
    "Concurrent",
    "RandomChannels",
    "Schedule",
    "Simulation",
    "agent_problems",
    "check_protocol",
    "deliver",
    "protocol_objects",
    "start",
    "violations",
]

_Kind = TypeVar("_Kind", bound=Protocol)


def protocol_objects(team: Team, protocol: type[_Kind]) -> dict[str, _Kind]:
    """Return a protocol object for each robot, by name. The protocols are not started yet.

    Args:
        team: The team, in priority order.
        protocol: The class of the protocol. Set its class attribute `settings` for other settings.
    """
    order = PriorityOrder(team.order)
    known = agent_problems(team, shared_scopes=protocol.traits.shared_scopes)
    return {name: protocol(LocalProblem(part), order) for name, part in known.items()}


def start(robots: Mapping[str, Protocol]) -> None:
    """Start all robots. Their first messages are in their outboxes."""
    for robot in robots.values():
        robot.start()


def deliver(robots: Mapping[str, Protocol]) -> list[tuple[str, str, Message]]:
    """Deliver all messages in the outboxes once. The robots' answers stay in the outboxes.

    Returns:
        The delivered messages, each with its sender and receiver.
    """
    sent = [(name, receiver, message) for name, robot in robots.items() for receiver, message in robot.outbox]
    for robot in robots.values():
        robot.outbox.clear()
    for sender, receiver, message in sent:
        robots[receiver].receive(sender, message)
    return sent


def check_protocol(  # noqa: PLR0913 - options, by name
    protocol: type[Protocol],
    problems: Iterable[Team] | None = None,
    *,
    teams: int = 20,
    robots: int = 3,
    values: int = 2,
    seed: int = 0,
    states: int = 20_000,
    packets: bool = False,
    losses: int = 0,
    crashes: int = 0,
    rejoins: int = 0,
    events: int = 0,
    runs: int = 20,
    settings: Mapping[str, str] | None = None,
) -> int:
    """Check a protocol: in every order in which messages can arrive on small teams, and at random on larger ones.

    In each order (`robochoc check`), verdicts and bounds must be right, no robot may refuse a message or fail, and a
    protocol that is `complete` must end with an answer. The same must hold in random runs in the simulator. Besides, a
    run must be the same again with the same seed, and `in_words` of each message must not fail.

    Args:
        protocol: The class of the protocol.
        problems: The teams (`Model.team`). None: random teams of the kinds that `protocol.traits` accept.
        teams: The number of random teams.
        robots: The maximum number of robots in a random team.
        values: The maximum number of values of a robot in a random team.
        seed: The seed of the random teams.
        states: The maximum number of states explored per team.
        packets: True to deliver also several waiting messages at once.
        losses: The maximum number of messages that are lost.
        crashes: The maximum number of robots that crash.
        rejoins: The maximum number of robots that crash and are restarted.
        events: The maximum number of events that change the problem: those of a team's scenario, or random ones.
        runs: The number of random runs: on random teams with up to two more robots and one more value, or on each of
            `problems`.
        settings: The settings of the protocol, as for `--set`.

    Returns:
        The number of states explored.

    Raises:
        AssertionError: if something does not hold. Its message explains the fault, with the deliveries that lead there.
        TypeError: if `protocol` is not a class of protocols, or lacks a part of one.
        UnsupportedError: if the protocol does not accept one of `problems`, or does not tolerate lost messages, crashes
            or events.
        ValueError: if a number is too small, or no team was checked.

    Example:
        >>> from robochoc.protocols.satisfaction.abt import ABT
        >>> from robochoc.testing import check_protocol
        >>> check_protocol(ABT, teams=5)
        196
    """
    __tracebackhide__ = True  # pytest shows the fault, not this function
    plan = FaultPlan(crashes, rejoins, events)
    least_of = {"teams": (teams, 1), "robots": (robots, 1), "values": (values, 1), "states": (states, 1)}
    others = {"losses": losses, "runs": runs, **plan._asdict()}
    _refuse_wrong(protocol, least_of | {name: (number, 0) for name, number in others.items()})
    run = Options(protocol=protocol.__name__, runtime=Runtime.SIMULATOR, seed=seed, settings=dict(settings or {}))
    options = CheckOptions(protocol, run, states, packets=packets, losses=losses, plan=plan)
    if problems is None:
        explored = [*itertools.islice(small_teams(protocol.traits, robots, values, seed), teams)]
        larger = [*itertools.islice(small_teams(protocol.traits, robots + 2, values + 1, seed), runs)]
    else:
        explored = [*problems]
        larger = explored * runs
    total = 0
    for one in checked(explored, options):
        total += one.exploration.states
        if one.exploration.fault:
            shown = reduced(one, options) if problems is None else one
            raise AssertionError(f"{protocol.__name__} on {shown.team.name}, {shown.report}")
    if not total:
        raise ValueError("no team was checked")
    for number, (team, case) in enumerate(cases_of(larger, options)):
        if fault := fault_in_simulation(case, seed + number):
            raise AssertionError(f"{protocol.__name__} on {team.name}, in a random run: {fault}")
    return total


def _refuse_wrong(protocol: object, numbers: Mapping[str, tuple[int, int]]) -> None:
    """Raise an error for wrong arguments. `numbers` are the values and the minimum of the others, by name."""
    if not (isinstance(protocol, type) and issubclass(protocol, Protocol)):
        raise TypeError(f"protocol={protocol!r} is not allowed; expected a class of protocols")
    if wrong := class_fault(protocol):
        raise TypeError(f"{protocol.__name__} {wrong}")
    for name, (number, least) in numbers.items():
        if number < least:
            raise ValueError(f"{name} is {number}; it must be {least} or more")
