"""Options that do not go with the problem, or with what the protocol can do."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from robochoc.model.change import team_after_events
from robochoc.model.problem import ProblemKind, Team
from robochoc.protocols.requirements import BREAKABLE, unmet_requirement
from robochoc.protocols.satisfaction.disac import DisAC
from robochoc.protocols.satisfaction.first_fit import FirstFit
from robochoc.protocols.traits import Traits
from robochoc.run.defaults import CENTRAL
from robochoc.run.options import Options, Runtime, Withdrawal
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.exclusions import allocation_fault
from robochoc.verification.objective import withdrawal_cost

LARGEST = 2**62
"""Costs that add up to more are refused: a message holds integers of 64 bits."""
CENTRAL_TRAITS = Traits(partially_known=True, asymmetric=True, costs=True)
"""The problems that the central solver supports."""


class UnfitProtocolError(UnsupportedError):
    """The protocol does not fit; another one may. `complete`: it must be one that proves its answers."""

    def __init__(self, why: str, *, complete: bool = False) -> None:
        super().__init__(why)
        self.complete = complete


@dataclass(frozen=True)
class RunCase:
    """A team, the options, and the traits of the protocol."""

    team: Team
    options: Options
    traits: Traits

    @property
    def has_costs(self) -> bool:
        """Return whether the problem has costs."""
        return self.team.kind == ProblemKind.DISWCSP

    @property
    def has_negative_costs(self) -> bool:
        """Return whether something was taken out of costs, so that none is negative."""
        return self.team.user_units.maximize or any(constraint.offset for constraint in self.team.constraints())

    @property
    def is_distributed(self) -> bool:
        """Return whether the robots solve the problem together, without the central solver."""
        return self.options.protocol != CENTRAL

    @property
    def minimum_withdrawal(self) -> bool:
        """Return whether as few robots as possible are to withdraw."""
        return self.is_distributed and self.options.withdraw == Withdrawal.MINIMUM

    @cached_property
    def epochs(self) -> tuple[Team, ...]:
        """The team after each event of its scenario, as far as that is known before."""
        return tuple(team_after_events(self.team, events) for events in range(len(self.team.scenario) + 1))

    @property
    def unknown_kills(self) -> str:
        """Robots that are to be killed, and are in the team at no time."""
        return ", ".join(sorted({kill.robot for kill in self.options.kill}.difference(*(e.order for e in self.epochs))))

    @property
    def max_total(self) -> float:
        """Return the largest possible sum of all costs in any epoch."""
        return max(max_total(team, self.options) for team in self.epochs)


def scenario_refusal(team: object, option: str) -> str:
    """Return why `option` is refused for a team whose problem changes over time."""
    return f"{team} has a scenario.xml; {option} is for problems that do not change"


class TeamRule(NamedTuple):
    """A case that is refused: the condition, the reason, and what to do instead.

    In the reason, `{team}` and `{protocol}` stand for the names, `{case}` for the case. With `other_protocol`, another
    one could do it; with `complete`, one that proves its answers.
    """

    refuses: Callable[[RunCase], object]
    why: str
    instead: str = ""
    other_protocol: bool = False
    complete: bool = False


def _not_with_scenario(option: str, given: Callable[[Options], object]) -> TeamRule:
    """Return the rule that an option is not for problems that change over time."""
    return TeamRule(lambda c: c.team.dynamic and given(c.options), scenario_refusal("{team}", option))


TEAM_RULES = (
    _not_with_scenario("--withdraw", lambda o: o.withdraw is not None),
    _not_with_scenario("--count", lambda o: o.count),
    TeamRule(
        lambda c: c.options.preprocess and c.minimum_withdrawal and c.traits.costs,
        "--preprocess removes values that do not go with robots that may withdraw (--withdraw minimum, {protocol})",
        "drop --preprocess, or choose a protocol that does not minimise costs",
        other_protocol=True,
    ),
    TeamRule(
        lambda c: (
            c.options.preprocess
            and any(unmet_requirement(robot, DisAC.traits, team.owner) for team in c.epochs for robot in team.robots)
        ),
        "{team} has partially known constraints (PKC), which --preprocess does not support: drop it",
    ),
    _not_with_scenario("--runtime network", lambda o: o.protocol != CENTRAL and o.runtime == Runtime.NETWORK),
    _not_with_scenario("--runtime arrays", lambda o: o.protocol != CENTRAL and o.runtime == Runtime.ARRAYS),
    TeamRule(lambda c: c.traits.lacks, "{protocol} needs {case.traits.lacks}"),
    TeamRule(
        lambda c: c.is_distributed and c.options.runtime == Runtime.ARRAYS and not c.traits.arrays,
        "{protocol} has no form as arrays",
        "add --runtime simulator, or choose a protocol that has one ('robochoc protocols --long')",
    ),
    TeamRule(lambda c: c.unknown_kills, "--kill names a robot that {team} does not have: {case.unknown_kills}"),
    TeamRule(
        lambda c: c.options.count and c.is_distributed and (c.options.runtime == "network" or not c.traits.counts),
        "--count is for --protocol central, or count-dpop on one machine: across machines it is one robot's word",
    ),
    TeamRule(
        lambda c: c.options.count and c.has_costs and not c.is_distributed,
        "{team} is a DisWCSP, where every assignment that breaks nothing hard is a solution",
        "add --protocol count-dpop, which counts optima",
    ),
    TeamRule(
        lambda c: c.is_distributed and (c.traits.costs or c.minimum_withdrawal) and c.max_total >= LARGEST,
        f"{{team}}'s costs could add up to {LARGEST:,} or more, which no message holds",
        "scale them down",
    ),
    TeamRule(
        lambda c: c.minimum_withdrawal and c.traits.costs and not c.traits.complete,
        "--withdraw minimum has to be proven, and {protocol} proves nothing",
        other_protocol=True,
        complete=True,
    ),
    TeamRule(
        lambda c: c.options.withdraw is not None and c.has_negative_costs,
        "{team} has negative costs, or utilities; with --withdraw a robot that withdraws would save or lose them",
        "add a constant to the costs of each constraint, so that all are 0 or more and minimised",
    ),
    TeamRule(
        lambda c: c.has_costs and c.options.withdraw == Withdrawal.MAXIMAL,
        "{team} is a DisWCSP; --withdraw maximal knows no costs",
        "--withdraw minimum does",
    ),
)
"""Problems, and protocols for a problem, that are refused."""


def refuse_unfit(team: Team, options: Options, traits: Traits) -> None:
    """Raise `UnsupportedError` for what does not go with the team, or with a protocol that has these `traits`.

    Args:
        team: the team with its scenario. Across machines: as far as the master sees it.
        options: how to run.
        traits: what the protocol of `options` can do; `CENTRAL_TRAITS` for the central solver.

    Raises:
        UnfitProtocolError: where another protocol could do it.
    """
    case = RunCase(team, options, traits)
    for rule in TEAM_RULES:
        if rule.refuses(case):
            why = rule.why.format(team=team.name, protocol=options.protocol, case=case)
            why = "; ".join(filter(None, [why, rule.instead]))
            raise UnfitProtocolError(why, complete=rule.complete) if rule.other_protocol else UnsupportedError(why)
    for epoch in case.epochs:
        for name, able in _takers(case):
            _refuse_constraints(epoch, name, able)


def _takers(case: RunCase) -> Iterator[tuple[str, Traits]]:
    """Yield all protocols that must support the constraints: the protocol, and those that take over from it."""
    options, traits = case.options, case.traits
    taken_over = case.minimum_withdrawal and not traits.costs
    if not (taken_over and case.has_costs):  # then soft constraints are left to what takes over
        yield options.protocol, traits
    if taken_over:
        yield "--withdraw minimum", Traits(costs=True)
    if options.withdraw == Withdrawal.MAXIMAL:
        yield "--withdraw maximal", FirstFit.traits
    if options.spares:
        yield "--spare", Traits(costs=True)


def _refuse_constraints(team: Team, name: str, traits: Traits) -> None:
    """Raise `UnfitProtocolError` for constraints that the one called `name` cannot take."""
    for robot in team.robots:
        unmet = unmet_requirement(robot, traits, team.owner)
        if unmet.endswith(BREAKABLE):
            raise UnsupportedError(f"{unmet}, which {name} does not support; --withdraw minimum does")
        if unmet:
            raise UnfitProtocolError(f"{unmet}, which {name} does not support")
    if traits.allocates and (fault := allocation_fault(team, congestion=traits.congestion)):
        raise UnfitProtocolError(f"{team.name} is not a task allocation, and {name} accepts nothing else: {fault}")


def max_total(team: Team, options: Options) -> float:
    """Return the maximum sum of all costs of `team`; withdrawal costs are included if robots may withdraw."""
    times = sum(robot.weight for robot in team.robots) + 1 if options.withdraw is not None else 1
    return withdrawal_cost(team) * times
