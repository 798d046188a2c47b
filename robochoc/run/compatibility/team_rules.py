"""Options that cannot be combined with the team, or with the traits of the protocol."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import NamedTuple

from robochoc.model.change import team_after_events
from robochoc.model.problem import ProblemKind, Team
from robochoc.model.symbols import real_places
from robochoc.protocols.requirements import BREAKABLE, unmet_requirement
from robochoc.protocols.satisfaction.disac import DisAC
from robochoc.protocols.satisfaction.first_fit import FirstFit
from robochoc.protocols.traits import Traits
from robochoc.run.defaults import CENTRAL, MASTER, standby_names
from robochoc.run.options import Options, Runtime, Withdrawal
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.exclusions import allocation_fault
from robochoc.system.lazy_dataclass import dataclass
from robochoc.verification.objective import withdrawal_cost

LARGEST = 2**62
"""The largest allowed sum of costs, because messages contain 64-bit integers."""
CENTRAL_TRAITS = Traits(partially_known=True, asymmetric=True, costs=True)
"""The problems that the central solver supports."""


class UnfitProtocolError(UnsupportedError):
    """The protocol does not fit, but another one may. `complete`: true if the other one must prove its answers."""

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
        """Return whether costs were shifted because some are negative."""
        return self.team.user_units.maximize or any(constraint.offset for constraint in self.team.constraints())

    @property
    def is_distributed(self) -> bool:
        """Return whether the robots solve the problem themselves, without the central solver."""
        return self.options.protocol != CENTRAL

    @property
    def minimum_withdrawal(self) -> bool:
        """Return whether the robots must find a minimum withdrawal."""
        return self.is_distributed and self.options.withdraw == Withdrawal.MINIMUM

    @cached_property
    def epochs(self) -> tuple[Team, ...]:
        """The team before and after each event in its scenario, for the events known before the run."""
        return tuple(team_after_events(self.team, events) for events in range(len(self.team.scenario) + 1))

    @property
    def unknown_kills(self) -> str:
        """The robots to be killed that are not in the team at any time, and are not masters."""
        standby = self.options.standby
        known = [*(e.order for e in self.epochs), (MASTER, *standby_names(standby)) if standby else ()]
        return ", ".join(sorted({kill.robot for kill in self.options.kill}.difference(*known)))

    @property
    def max_total(self) -> float:
        """Return the largest possible sum of all costs in any epoch."""
        return max(max_total(team, self.options) for team in self.epochs)


def scenario_refusal(team: object, option: str) -> str:
    """Return the reason why `option` is refused for a team whose problem changes over time."""
    return f"{team} has a scenario.xml; {option} is for problems that do not change"


class TeamRule(NamedTuple):
    """A run that is refused: the condition, the reason, and an alternative.

    The reason may contain `{team}` and `{protocol}` for the names, and `{case}` for the run. `other_protocol`: another
    protocol may support the run; `complete`: only a complete protocol may.
    """

    refuses: Callable[[RunCase], object]
    why: str
    instead: str = ""
    other_protocol: bool = False
    complete: bool = False


def _not_with_scenario(option: str, given: Callable[[Options], object]) -> TeamRule:
    """Return the rule that refuses an option for problems that change over time."""
    return TeamRule(lambda c: c.team.dynamic and given(c.options), scenario_refusal("{team}", option))


TEAM_RULES = (
    _not_with_scenario("--withdraw", lambda o: o.withdraw is not None),
    _not_with_scenario("--count", lambda o: o.count),
    TeamRule(
        lambda c: c.options.preprocess and c.minimum_withdrawal and c.traits.costs,
        "--preprocess removes values that are possible if other robots withdraw (--withdraw minimum, {protocol})",
        "remove --preprocess, or choose a protocol that does not minimise costs",
        other_protocol=True,
    ),
    TeamRule(
        lambda c: (
            c.options.preprocess
            and any(unmet_requirement(robot, DisAC.traits, team.owner) for team in c.epochs for robot in team.robots)
        ),
        "{team} has partially known constraints (PKC), which --preprocess does not support: remove --preprocess",
    ),
    _not_with_scenario("--runtime network", lambda o: o.protocol != CENTRAL and o.runtime == Runtime.NETWORK),
    _not_with_scenario("--runtime arrays", lambda o: o.protocol != CENTRAL and o.runtime == Runtime.ARRAYS),
    TeamRule(
        lambda c: c.options.verify and real_places(c.team),
        "--verify confirms optima of integer variables, and {team} has real variables, whose bound takes its place",
        "remove --verify",
    ),
    TeamRule(
        lambda c: c.options.verify and any(robot.sampled for robot in c.team.robots),
        "--verify confirms optima, and answers of {team} are only the best for samples of its random variables",
        "remove --verify",
    ),
    TeamRule(lambda c: c.traits.lacks, "{protocol} needs {case.traits.lacks}"),
    TeamRule(
        lambda c: c.is_distributed and c.options.runtime == Runtime.ARRAYS and not c.traits.arrays,
        "{protocol} has no array implementation",
        "add --runtime simulator, or choose a protocol that has one ('robochoc protocols --long')",
    ),
    TeamRule(
        lambda c: not c.options.standby and MASTER in c.unknown_kills.split(", "),
        "--kill MASTER kills the first of several masters",
        "add --runtime network --standby N",
    ),
    TeamRule(lambda c: c.unknown_kills, "--kill names a robot that {team} does not have: {case.unknown_kills}"),
    TeamRule(
        lambda c: c.options.count and c.is_distributed and (c.options.runtime == "network" or not c.traits.counts),
        "--count is for --protocol central, or count-dpop on one machine: across machines the number cannot be checked",
    ),
    TeamRule(
        lambda c: c.options.count and c.has_costs and not c.is_distributed,
        "{team} has costs (DCOP), so every assignment that satisfies the hard constraints is a solution",
        "add --protocol count-dpop instead of central: it counts optima",
    ),
    TeamRule(
        lambda c: c.is_distributed and (c.traits.costs or c.minimum_withdrawal) and c.max_total >= LARGEST,
        f"{{team}}'s costs could add up to {LARGEST:,} or more, which does not fit into a message",
        "scale the costs down",
    ),
    TeamRule(
        lambda c: c.minimum_withdrawal and c.traits.costs and not c.traits.complete,
        "--withdraw minimum requires a proof, but {protocol} is incomplete",
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
        "{team} has costs (DCOP), which --withdraw maximal ignores",
        "use --withdraw minimum",
    ),
)
"""Refused combinations of team, options and protocol."""


def refuse_unfit(team: Team, options: Options, traits: Traits) -> None:
    """Raise `UnsupportedError` if the options cannot be combined with the team or with the traits of the protocol.

    Args:
        team: The team with its scenario. In a run across machines: the part of the team that the master sees.
        options: How to run.
        traits: The traits of the protocol of `options`; `CENTRAL_TRAITS` for the central solver.

    Raises:
        UnfitProtocolError: if another protocol may support the run.
    """
    case = RunCase(team, options, traits)
    for rule in TEAM_RULES:
        if rule.refuses(case):
            why = rule.why.format(team=team.name, protocol=options.protocol, case=case)
            why = "; ".join(filter(None, [why, rule.instead]))
            raise UnfitProtocolError(why, complete=rule.complete) if rule.other_protocol else UnsupportedError(why)
    for epoch in case.epochs:
        for name, required in _requirements(case):
            _refuse_constraints(epoch, name, required)


def _requirements(case: RunCase) -> Iterator[tuple[str, Traits]]:
    """Yield the names and traits of the protocols of all phases. They must support the constraints."""
    options, traits = case.options, case.traits
    taken_over = case.minimum_withdrawal and not traits.costs
    if not (taken_over and case.has_costs):  # otherwise the second phase minimises the costs
        yield options.protocol, traits
    if taken_over:
        yield "--withdraw minimum", Traits(costs=True)
    if options.withdraw == Withdrawal.MAXIMAL:
        yield "--withdraw maximal", FirstFit.traits
    if options.spares:
        yield "--spare", Traits(costs=True)


def _refuse_constraints(team: Team, name: str, traits: Traits) -> None:
    """Raise `UnfitProtocolError` for constraints that the protocol or the option `name` does not support."""
    for robot in team.robots:
        unmet = unmet_requirement(robot, traits, team.owner)
        if unmet.endswith(BREAKABLE):
            raise UnsupportedError(f"{unmet}, which {name} does not support; --withdraw minimum does")
        if unmet:
            raise UnfitProtocolError(f"{unmet}, which {name} does not support")
    if traits.allocates and (fault := allocation_fault(team, congestion=traits.congestion)):
        raise UnfitProtocolError(f"{team.name} is not a task allocation, and {name} accepts nothing else: {fault}")


def max_total(team: Team, options: Options) -> float:
    """Return the maximum sum of all costs of `team`, including withdrawal costs if robots may withdraw."""
    times = sum(robot.weight for robot in team.robots) + 1 if options.withdraw is not None else 1
    return withdrawal_cost(team) * times
