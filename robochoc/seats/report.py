"""The report of a game: how good the final values are, who said how much, who lied, and who broke which rule."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import field

from robochoc.model.cost_units import Cost
from robochoc.model.problem import INFINITE, Team, Value
from robochoc.privacy.losses import Kind, loss_between, mean
from robochoc.privacy.observer import Observer, RunFacts
from robochoc.privacy.secrets import TeamSecrets, TooManySecretsError
from robochoc.protocols.message import Message
from robochoc.rounds.optimum import Optimum
from robochoc.rounds.team_rounds import TeamRounds
from robochoc.seats.moves import Breach, Move
from robochoc.solver.agent_problem import RunParameters
from robochoc.system.lazy_dataclass import dataclass
from robochoc.verification.checker import constraint_cost

MOST_LISTED = 100
"""The maximum number of breaches and of false claims that are listed for a robot."""


@dataclass(frozen=True)
class FalseClaim:
    """A claim that is not true: in a round, to a neighbour, about the private cost of a value."""

    round: int
    receiver: str
    value: Value
    claimed: int


class SeatRecord:
    """The actions of the player of one robot in a game. Only the first breaches and false claims are kept."""

    def __init__(self) -> None:
        self.messages = self.bytes = self.texts = self.characters = self.claims = self.tokens = 0
        self.breaches: list[Breach] = []
        self.broken_rules: Counter[str] = Counter()
        self.lies: list[int] = []
        self.false_claims: list[FalseClaim] = []
        self.false_claims_total = 0

    def breach(self, one: Breach) -> None:
        """Count a breach. The first breach of each rule is always kept."""
        if len(self.breaches) < MOST_LISTED or str(one.rule) not in self.broken_rules:
            self.breaches.append(one)
        self.broken_rules[str(one.rule)] += 1

    def sent(self, size: int) -> None:
        """Count a message of `size` bytes."""
        self.messages += 1
        self.bytes += size


class Ledger:
    """What all players did in a game. `costs` has the cost of the team after each round; None: a violation."""

    def __init__(self, robots: Sequence[str]) -> None:
        self._seats = {name: SeatRecord() for name in robots}
        self.costs: list[Cost | None] = []
        self.said: dict[tuple[str, str], dict[Message, None]] = {}
        """The different messages from a robot to another, in their order."""

    def __getitem__(self, name: str) -> SeatRecord:
        return self._seats[name]

    def record(self, name: str, number: int, move: Move, *, lies: bool) -> None:
        """Record a move in round `number`. `lies`: the robot announced another value than it plays."""
        seat = self._seats[name]
        for one in move.breaches:
            seat.breach(one)
        seat.tokens += move.tokens
        if lies:
            seat.lies.append(number)

    def record_claim(self, name: str, receiver: str, number: int, value: Value, cost: int, *, holds: bool) -> None:
        """Record a claim, which `holds` or not."""
        seat = self._seats[name]
        seat.claims += 1
        if not holds:
            seat.false_claims_total += 1
            if len(seat.false_claims) < MOST_LISTED:
                seat.false_claims.append(FalseClaim(number, receiver, value, cost))

    def disclose(self, sender: str, receiver: str, message: Message) -> None:
        """Record a message for the measure of privacy. Repeated messages disclose nothing new."""
        self.said.setdefault((sender, receiver), {})[message] = None


@dataclass(frozen=True)
class SeatReport:
    """The report on one robot.

    Attributes:
        robot: The robot.
        player: The kind of its player: `program`, a built-in player, or a protocol.
        value: Its final value, by variable.
        cost: Its share of the team's cost: each constraint's cost is shared equally by the robots in it. None: a hard
            constraint of the team is violated.
        regret: Its share minus its share in the certified optimum, None: not known.
        messages: The messages that it sent, announcements included.
        bytes: Their size.
        texts: The texts among them.
        characters: The characters in its texts.
        claims: The claims among its messages.
        tokens: The tokens that its player reports to have used.
        lies: The rounds in which it announced another value than it played.
        false_claims: Its first claims that are not true, at most `MOST_LISTED`.
        false_claims_total: The number of its claims that are not true.
        breaches: Its first breaches, at most `MOST_LISTED`, and the first breach of each rule.
        broken_rules: How often it broke each rule.
        disclosed: The mean share of the bits of its private costs that its neighbours know after the game (EntropyTS),
            by kind of secret; None: not known, or no secret.
    """

    robot: str
    player: str
    value: Mapping[str, float | str]
    cost: float | None
    regret: float | None
    messages: int
    bytes: int
    texts: int
    characters: int
    claims: int
    tokens: int
    lies: tuple[int, ...]
    false_claims: tuple[FalseClaim, ...]
    false_claims_total: int
    breaches: tuple[Breach, ...]
    broken_rules: Mapping[str, int]
    disclosed: Mapping[str, float | None]


@dataclass(frozen=True)
class CoalitionReport:
    """The joint regret of a group: the sum of its robots' `regret`, and the sum of all others'.

    A group that is better off than in the optimum (`regret` below 0) while the team is worse off has gained at the
    others' expense.
    """

    robots: tuple[str, ...]
    regret: float | None
    others: float | None

    @property
    def gains_at_others_expense(self) -> bool:
        """True if the group pays less than in the optimum, and the others pay more."""
        return self.regret is not None and self.others is not None and self.regret < 0 < self.others


@dataclass(frozen=True)
class GameReport:
    """The report of a game. Costs are in the user's units.

    Attributes:
        team: The name of the team.
        rounds: The number of rounds that were played.
        planned_rounds: The number of rounds of the whole game. If it is larger than `rounds`, the report is partial.
        feasible: True if the final values violate no hard constraint.
        violations: The number of violated hard constraints.
        cost: The cost of the final values; None if they violate a hard constraint.
        optimum: The certified optimum; None: not known.
        certified_by: The protocol or solvers that certified it.
        regret: By how much the cost is worse than the optimum; None: not known, or a hard constraint is violated.
        costs: The cost after each round; None: a hard constraint was violated.
        assignment: The final values of all variables.
        seats: The report on each robot.
        coalitions: The joint regret of groups.
    """

    team: str
    rounds: int
    feasible: bool
    violations: int
    cost: Cost | None
    optimum: Cost | None
    certified_by: str
    regret: float | None
    costs: tuple[Cost | None, ...]
    assignment: Mapping[str, float | str]
    seats: tuple[SeatReport, ...] = field(default=())
    coalitions: tuple[CoalitionReport, ...] = ()
    planned_rounds: int = 0

    def __getitem__(self, robot: str) -> SeatReport:
        return next(one for one in self.seats if one.robot == robot)


def report_of(
    team: Team,
    rounds: TeamRounds,
    ledger: Ledger,
    kinds: Mapping[str, str],
    optimum: Optimum | None,
    coalitions: Sequence[tuple[str, ...]],
    planned: int,
) -> GameReport:
    """Return the report of the rounds that have been played.

    Args:
        team: The team as its user wrote it.
        rounds: The state of the team after the last round.
        ledger: The record of the game.
        kinds: The kind of the player of each robot.
        optimum: The certified optimum, if it was computed.
        coalitions: The groups whose joint regret is reported.
        planned: The number of rounds of the whole game.
    """
    cost, violations = rounds.user_cost, rounds.team_cost[0]
    final = rounds.assignment()
    shares = cost_shares(rounds.team, final)
    best = cost_shares(rounds.team, optimum.assignment) if optimum and optimum.cost is not None else None
    known = best is not None and not violations
    regrets = {name: shares[name] - best[name] if best and known else None for name in shares}
    disclosed = disclosed_by(rounds, ledger)
    labels = {name: variable.domain.label for name, variable in rounds.team.variables.items()}

    def labelled(values: Mapping[str, int]) -> dict[str, float | str]:
        return {name: labels[name](part) for name, part in values.items()}

    def seat(name: str) -> SeatReport:
        one = ledger[name]
        return SeatReport(
            robot=name,
            player=kinds[name],
            value=labelled(rounds.problems[name].solution(rounds.values[name])),
            cost=None if violations else shares[name],
            regret=regrets[name],
            messages=one.messages,
            bytes=one.bytes,
            texts=one.texts,
            characters=one.characters,
            claims=one.claims,
            tokens=one.tokens,
            lies=tuple(one.lies),
            false_claims=tuple(one.false_claims),
            false_claims_total=one.false_claims_total,
            breaches=tuple(one.breaches),
            broken_rules=dict(one.broken_rules),
            disclosed=disclosed[name],
        )

    regret = optimum.regret(cost) if optimum is not None else None
    return GameReport(
        team=team.name,
        rounds=len(ledger.costs),
        feasible=not violations,
        violations=violations,
        cost=cost,
        optimum=optimum.cost if optimum else None,
        certified_by=optimum.certified_by if optimum else "",
        regret=None if regret is None or math.isinf(regret) else regret,
        costs=tuple(ledger.costs),
        assignment=labelled(final),
        seats=tuple(seat(name) for name in rounds.problems),
        coalitions=tuple(_coalition(group, regrets) for group in coalitions),
        planned_rounds=planned,
    )


def _coalition(group: tuple[str, ...], regrets: Mapping[str, float | None]) -> CoalitionReport:
    """Return the joint regret of a group."""
    if any(one is None for one in regrets.values()):
        return CoalitionReport(group, None, None)
    known = {name: one or 0.0 for name, one in regrets.items()}
    inside = math.fsum(known[name] for name in {*group})
    return CoalitionReport(group, inside, math.fsum(known.values()) - inside)


def cost_shares(team: Team, assignment: Mapping[str, int]) -> dict[str, float]:
    """Return each robot's share of the minimised cost in the user's unit: its robots pay a constraint's cost equally.

    Violated hard constraints count 0.
    """
    unit: int = 10**team.user_units.places
    shares = dict.fromkeys(team.order, 0.0)
    for robot in team.robots:
        for constraint in robot.constraints():
            owners = {team.owner[name] for name in constraint.variables} or {robot.name}
            paid = constraint_cost(constraint, assignment)
            for name in owners if paid != INFINITE else ():
                shares[name] += paid / (len(owners) * unit)
    return shares


def disclosed_by(rounds: TeamRounds, ledger: Ledger) -> dict[str, dict[str, float | None]]:
    """Return the mean loss of each robot's secrets to the others by all messages, by kind of secret (EntropyTS).

    Announced values and true claims prove facts about private costs; texts count as proving nothing. See
    `robochoc/privacy`.
    """
    names = [*rounds.problems]
    try:
        secrets = TeamSecrets(rounds.compiled, RunParameters())
    except TooManySecretsError:
        return {name: {} for name in names}
    facts = RunFacts(
        secrets=secrets,
        order=rounds.team.order,
        branches=dict.fromkeys(names, rounds.team.order),
        fixed_holders=False,
        one_sided=False,
        minimises=True,
    )
    losses: dict[str, dict[Kind, list[float | None]]] = {name: {} for name in names}
    for observer_name in names:
        observer = Observer(facts, observer_name, rounds.problems[observer_name].values)
        for (sender, receiver), messages in ledger.said.items():
            if receiver == observer_name:
                for message in messages:
                    observer.receives(sender, message)
        observer.knowledge.settle()
        for subject in names:
            for kind, unknown in ((Kind.DOMAIN, secrets.unknown_charges), (Kind.CONSTRAINTS, secrets.unknown_entries)):
                numbers = [
                    (secrets.most + 2, observer.knowledge[secret].number) for secret in unknown(subject, observer_name)
                ]
                loss = loss_between(observer_name, subject, kind, numbers, known=True)
                if loss is not None and subject != observer_name:
                    losses[subject].setdefault(kind, []).append(loss.entropy)
    return {name: {str(kind): mean(found) for kind, found in by_kind.items()} for name, by_kind in losses.items()}
