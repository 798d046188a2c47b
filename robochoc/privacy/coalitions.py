"""Measures what coalitions of robots learn, exhaustively, for small problems.

A coalition puts together all messages that its members receive, their own problems and random numbers. The secrets are
the costs in the other robots' constraints that no member shares. For each possible table of these costs the run is
repeated: the coalition can exclude a table if its messages would differ, or its own values at the end. A table that it
can exclude by its values alone is excluded by the answer, not by the protocol.

Messages are compared sender by sender, in a fixed order of delivery: conclusions from times and from the order of
different senders' messages do not count. Fields that are masked by random numbers (`Message.masked`) are compared by
their length only: a minority would see the same distribution with any table.

Random numbers of the other robots are unknown to a coalition. Each table is tried with several of them; a table with
which none gives the same messages counts as excluded, although others might. So too many tables can be excluded, but
not too few, for protocols that draw random numbers; for others the number is exact. A table with which the protocol
would refuse the run is excluded.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import msgspec

from robochoc.communication.host import Host, order_of
from robochoc.model.problem import INFINITE, Constraint, ConstraintModel, ProblemKind, Relation, Robot, Semantics, Team
from robochoc.privacy.errors import PrivacyError
from robochoc.privacy.secrets import MOST_SECRETS
from robochoc.protocols.message import Envelope
from robochoc.protocols.protocol import Protocol
from robochoc.sniffer.recorded_messages import types_by_name
from robochoc.solver.agent_problem import AgentProblem, RunParameters, agent_problems
from robochoc.solver.compiled_domain import compile_domain
from robochoc.solver.compiled_team import CompiledTeam, CompileRobot
from robochoc.solver.errors import TooLargeError
from robochoc.solver.local_problem import LocalProblem
from robochoc.system.lazy_dataclass import dataclass

MOST_TABLES = 100_000
MOST_MESSAGES = 1_000_000

View = Mapping[tuple[str, str], Sequence[object]]
"""The visible parts of all messages that a coalition receives, by sender and receiver."""


@dataclass(frozen=True)
class CoalitionLoss:
    """The tables of other robots that a coalition cannot exclude.

    Attributes:
        members: The robots of the coalition.
        tables: The number of possible tables of the other robots' secret costs.
        by_values: The number of tables that agree with the members' own values in the answer.
        by_messages: The number of tables that also agree with all received messages.
    """

    members: tuple[str, ...]
    tables: int
    by_values: int
    by_messages: int

    @property
    def excluded_by_values(self) -> float:
        """The share of tables that the coalition can exclude by its own values in the answer."""
        return 1 - self.by_values / self.tables

    @property
    def excluded_by_messages(self) -> float:
        """The share of the remaining tables that it can exclude by the messages."""
        return 1 - self.by_messages / self.by_values


@dataclass(frozen=True)
class CoalitionReport:
    """The losses to all coalitions of one size.

    Attributes:
        team: The name of the team.
        protocol: The name of the protocol, or of its class.
        robots: All robots, the highest priority first.
        size: The number of robots in each coalition.
        coins: The number of seeds that were tried for the other robots' random numbers.
        is_exact: True if the other robots drew no random numbers that a coalition can see.
        losses: The losses to each coalition with secrets left to learn.
    """

    team: str
    protocol: str
    robots: tuple[str, ...]
    size: int
    coins: int
    is_exact: bool
    losses: tuple[CoalitionLoss, ...]


class _Played(NamedTuple):
    """A finished run: what a coalition sees of it, and its own result."""

    view: View
    result: object
    is_random: bool


def coalition_report(
    team: Team,
    protocol: type[Protocol],
    size: int,
    *,
    parameters: RunParameters | None = None,
    coins: int = 1,
    costs: Sequence[float] = (),
    compile_robot: CompileRobot = compile_domain,
) -> CoalitionReport:
    """Return the losses to each coalition of `size` robots in a run of `protocol`.

    Args:
        team: The team, with normalised costs.
        protocol: The protocol.
        size: The number of robots in a coalition.
        parameters: The seed and the settings.
        coins: The number of seeds to try for the other robots' random numbers.
        costs: The possible costs of a secret entry; by default infinite, or an integer up to the largest in the team.
        compile_robot: Compiles each robot with each table.

    Raises:
        PrivacyError: if the team is too large, or the protocol's messages cannot be compared.
        Exception: the errors of `compile_robot`.
    """
    _check(team, protocol, size)
    given = parameters or RunParameters()
    losses, exact = [], True
    known_costs = tuple(costs)

    def play(team: Team, members: Collection[str], coin: int) -> _Played:
        return _play(CompiledTeam(team, compile_robot), protocol, given, members, coin)

    for members in itertools.combinations(team.order, size):
        secret = _secret_constraints(team, members)
        if not secret:
            continue
        known_costs = known_costs or _possible_costs(team)
        number = _number_of_tables(secret, team, known_costs)
        actual = play(team, members, 0)
        by_values = by_messages = 0
        for table in _tables(secret, team, known_costs):
            changed = _with_constraints(team, table)
            alike = seen = False
            for coin in range(coins):
                try:
                    played = play(changed, members, coin)
                except TooLargeError:
                    continue
                alike = alike or played.result == actual.result
                seen = played.view == actual.view and played.result == actual.result
                exact = exact and not played.is_random
                if seen or not played.is_random:
                    break
            by_values, by_messages = by_values + alike, by_messages + seen
        losses.append(CoalitionLoss(members, number, by_values, by_messages))
    return CoalitionReport(team.name, protocol.__name__, tuple(team.order), size, coins, exact, tuple(losses))


def _check(team: Team, protocol: type[Protocol], size: int) -> None:
    robots = len(team.order)
    if not 1 <= size < robots:
        raise PrivacyError(f"a coalition of {size} robots leaves none of {robots}: use 1 to {robots - 1}")
    if any(one.model == ConstraintModel.PKC for one in team.constraints()):
        raise PrivacyError("coalitions are not measured for partially known constraints")
    masks = any(kind.masked for kind in types_by_name(protocol).values())
    if masks and 2 * size >= robots:
        raise PrivacyError(
            f"the protocol hides secrets only from fewer than half of the {robots} robots: a larger coalition can"
            " combine its shares, and learn everything"
        )
    if protocol.traits.secret_keys and not masks:
        raise PrivacyError(
            "the protocol draws secret keys, and its messages do not declare what these hide: the loss to a coalition"
            " is not known"
        )


# Tables


def _possible_costs(team: Team) -> tuple[float, ...]:
    """Return the possible costs of an entry, as in `robochoc/privacy/secrets.py`."""
    if team.kind == ProblemKind.DISCSP:
        return (0, INFINITE)
    entries = _number_of_entries(team.constraints(), team)
    if entries > MOST_SECRETS:
        raise PrivacyError(f"the constraints have {entries:,} entries, more than {MOST_SECRETS:,}: use a smaller team")
    finite = [cost for one in team.constraints() for _, cost in _entries(one, team) if cost < INFINITE]
    most = int(max(finite, default=0))
    if most >= MOST_TABLES:
        raise PrivacyError(f"an entry has {most + 2:,} possible costs, more than {MOST_TABLES:,}: use lower costs")
    return (*range(most + 1), INFINITE)


def _number_of_entries(constraints: Iterable[Constraint], team: Team) -> int:
    return sum(math.prod(len(team.variables[name].domain) for name in one.variables) for one in constraints)


def _entries(constraint: Constraint, team: Team) -> Iterator[tuple[tuple[int, ...], float]]:
    """Yield each combination of values of a constraint, and its cost."""
    names = constraint.variables
    for values in itertools.product(*(team.variables[name].domain for name in names)):
        yield values, constraint.price(dict(zip(names, values, strict=True)))


def _secret_constraints(team: Team, members: Collection[str]) -> list[Constraint]:
    """Return the constraints that no member has in its file or shares."""
    owners = {name: robot.name for robot in team.robots for name in (one.name for one in robot.variables)}
    return [
        one
        for robot in team.robots
        if robot.name not in members
        for one in (*robot.private, *robot.shared)
        if not any(owners[name] in members for name in one.variables)
    ]


def _number_of_tables(secret: Sequence[Constraint], team: Team, costs: Sequence[float]) -> int:
    entries = _number_of_entries(secret, team)
    if len(costs) ** entries > MOST_TABLES:
        raise PrivacyError(
            f"the other robots' constraints have {entries:,} secret entries of {len(costs)} possible costs, more than"
            f" {MOST_TABLES:,} tables: use a smaller team"
        )
    return int(len(costs) ** entries)


def _tables(secret: Sequence[Constraint], team: Team, costs: Sequence[float]) -> Iterator[dict[int, Constraint]]:
    """Yield all replacements of the secret constraints, by the identity of the replaced constraint."""
    rows = [[values for values, _ in _entries(one, team)] for one in secret]
    for chosen in itertools.product(*(itertools.product(costs, repeat=len(one)) for one in rows)):
        yield {
            id(old): _with_costs(old, tuples, prices, team.kind)
            for old, tuples, prices in zip(secret, rows, chosen, strict=True)
        }


def _with_costs(
    constraint: Constraint, rows: Sequence[tuple[int, ...]], prices: Sequence[float], kind: ProblemKind
) -> Constraint:
    names = constraint.variables
    if kind == ProblemKind.DISCSP:
        broken = tuple(values for values, price in zip(rows, prices, strict=True) if price == INFINITE)
        relation = Relation(constraint.name, len(names), Semantics.CONFLICTS, broken)
    else:
        relation = Relation(constraint.name, len(names), Semantics.SOFT, tuple(rows), tuple(prices))
    return replace(constraint, definition=relation, scope=names, parameters=names)


def _with_constraints(team: Team, changed: Mapping[int, Constraint]) -> Team:
    def new(constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
        return tuple(changed.get(id(one), one) for one in constraints)

    def robot_with(robot: Robot) -> Robot:
        parents = tuple(replace(one, constraints=new(one.constraints)) for one in robot.parents)
        return replace(robot, private=new(robot.private), parents=parents)

    return replace(team, robots=tuple(map(robot_with, team.robots)))


# Runs


class _Drawn:
    """Counts the random numbers that robots draw."""

    def __init__(self) -> None:
        self.is_random = False

    def watch(self, protocol: Protocol) -> None:
        """Count what this robot draws."""
        chance, secret = protocol.chance, protocol.secret

        def draw() -> float:
            self.is_random = True
            return chance()

        def draw_secret(bits: int) -> int:
            self.is_random = True
            return secret(bits)

        protocol.chance, protocol.secret = draw, draw_secret


def _play(
    team: CompiledTeam, protocol: type[Protocol], given: RunParameters, members: Collection[str], coin: int
) -> _Played:
    """Run the protocol: messages are delivered one at a time, in the order in which they were sent."""
    traits = protocol.traits
    parts = agent_problems(team, given, shared_scopes=traits.shared_scopes, tree=traits.tree)
    drawn = _Drawn()
    hosts = {name: _host(protocol, part, 0 if name in members else coin) for name, part in parts.items()}
    for name, host in hosts.items():
        if name not in members:
            drawn.watch(host.protocol)
    masked = {name: kind.masked for name, kind in types_by_name(protocol).items() if kind.masked}
    fields = {name: kind.__struct_fields__ for name, kind in types_by_name(protocol).items()}
    view: dict[tuple[str, str], list[object]] = {}
    waiting: deque[Envelope] = deque()
    for host in hosts.values():
        waiting += host.start()
    for _ in range(MOST_MESSAGES):
        if not waiting:
            break
        envelope = waiting.popleft()
        if envelope.receiver in members and envelope.sender not in members:
            seen = _visible(envelope.content, masked, fields)
            view.setdefault((envelope.sender, envelope.receiver), []).append(seen)
        waiting += hosts[envelope.receiver].handle([envelope])
    else:
        raise PrivacyError(f"the run needs more than {MOST_MESSAGES:,} messages: use a smaller team")
    verdict = next((host.protocol.verdict for host in hosts.values() if host.protocol.verdict is not None), None)
    values = None if verdict is not None else [hosts[name].protocol.assignment for name in members]
    return _Played(view, (verdict, values), drawn.is_random)


def _host(protocol: type[Protocol], part: AgentProblem, coin: int) -> Host:
    parameters = part.parameters._replace(seed=part.parameters.seed + coin)
    return Host(protocol(LocalProblem(part), order_of(part)), parameters)


def _visible(content: bytes, masked: Mapping[str, frozenset[str]], fields: Mapping[str, tuple[str, ...]]) -> object:
    """Return the content of a message; masked fields are replaced by their lengths."""
    if not masked:
        return content
    tag, *values = msgspec.msgpack.decode(content)
    hidden = masked.get(tag, frozenset())
    return tag, [len(value) if name in hidden else value for name, value in zip(fields[tag], values, strict=True)]
