"""The rules on which problems, protocols, runtimes and options can be combined. No other module decides this.

There are three lists. Each rule has a condition, the reason, and what to do instead:

- `OPTION_RULES`: options that do not go together, whatever the problem is;
- `TEAM_RULES`: options that do not go with the problem, or with what the protocol can do (its traits);
- the constraints that a protocol must be able to take (`protocols/requirements.py`, where robots on a network, whose
  files nobody else sees, ask as well).

The command line, the API, and robots on a network ask here. Options are named as on the command line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from robochoc.model.change import team_after_events
from robochoc.model.problem import ProblemKind, Team
from robochoc.protocols.requirements import unmet_requirement
from robochoc.protocols.satisfaction.disac import DisAC
from robochoc.protocols.satisfaction.first_fit import FirstFit
from robochoc.protocols.traits import Traits
from robochoc.run.defaults import MOST_LOSS
from robochoc.run.options import CENTRAL, CentralSolverName, OnLoss, Options, Runtime, ScheduleName, Withdrawal
from robochoc.solver.encoding import UnsupportedError
from robochoc.solver.exclusions import allocation_fault
from robochoc.verification.objective import withdrawal_cost

LARGEST = 2**62
"""Costs that add up to more are refused: a message holds integers of 64 bits."""
LEAST_SEED, LARGEST_SEED = -(2**63), 2**64 - 1
"""Journals and robots on a network are told the seed in msgpack, whose integers are no longer."""
CENTRAL_TRAITS = Traits(partially_known=True, asymmetric=True, costs=True)
"""The problems that the central solver supports."""


class UnfitProtocolError(UnsupportedError):
    """The protocol does not fit; another one may. `complete`: it must be one that proves its answers."""

    def __init__(self, why: str, *, complete: bool = False) -> None:
        super().__init__(why)
        self.complete = complete


# Options that do not go together


class OptionRule(NamedTuple):
    """Options that are refused: the condition, the reason, and what to do instead."""

    refuses: Callable[[Options], object]
    why: str
    instead: str = ""


def _for_robots(option: str, given: Callable[[Options], object]) -> OptionRule:
    """Return the rule that the central solver has no use for an option."""
    why = f"{option} is for robots that solve it together, not for --protocol central"
    return OptionRule(lambda o: o.protocol == CENTRAL and given(o), why)


def _not_while_changing(option: str, given: Callable[[Options], object]) -> OptionRule:
    """Return the rule that an option is not for problems that change with the robots' situation."""
    return OptionRule(given, f"{option} is for problems that do not change; --situation changes this one")


def _is_delayed(options: Options) -> bool:
    """Return whether messages are delayed, or ordered, otherwise than by default."""
    return bool(options.delay) or options.schedule is not ScheduleName.CONCURRENT


_WITHOUT_PROCESSES = frozenset({Runtime.SIMULATOR, Runtime.ARRAYS})

OPTION_RULES = (
    OptionRule(lambda o: not LEAST_SEED <= o.seed <= LARGEST_SEED, "--seed is a number of 64 bits: less than 2^64"),
    OptionRule(
        lambda o: o.channel and o.runtime is not Runtime.SIMULATOR,
        "--channel is the simulator's",
        "add --runtime simulator",
    ),
    OptionRule(
        lambda o: o.channel and _is_delayed(o),
        "--channel says how long messages take",
        "drop --delay and --schedule",
    ),
    OptionRule(
        lambda o: _is_delayed(o) and o.runtime is not Runtime.SIMULATOR,
        "--delay and --schedule are the simulator's",
        "add --runtime simulator",
    ),
    OptionRule(
        lambda o: o.delay and o.schedule in {ScheduleName.CYCLES, ScheduleName.RANDOM},
        "--delay is for --schedule concurrent: in a random one any message may take any time, in cycles each takes one",
    ),
    OptionRule(lambda o: o.deadline and o.timeout, "--deadline and --timeout both limit the time: give one of them"),
    OptionRule(lambda o: o.improve and not o.deadline, "--improve goes on after --deadline SECONDS: add it"),
    OptionRule(lambda o: not 0 <= o.message_loss <= MOST_LOSS, "--message-loss is a probability from 0 to 0.9"),
    OptionRule(
        lambda o: o.loss and (o.runtime is Runtime.ARRAYS or o.preprocess or o.wants_anytime),
        "--message-loss goes with no --runtime arrays, --preprocess or --set anytime=yes",
    ),
    OptionRule(
        lambda o: o.ncccs is not None and o.runtime is not Runtime.SIMULATOR,
        "--ncccs is a limit for the simulator, which knows all clocks",
        "add --runtime simulator",
    ),
    OptionRule(
        lambda o: o.cycles is not None and o.schedule is not ScheduleName.CYCLES,
        "--cycles is a limit on the simulator's cycles",
        "add --runtime simulator --schedule cycles (a local search has its own number of cycles: --set cycles=N)",
    ),
    OptionRule(
        lambda o: o.protocol == CENTRAL and o.verify,
        "--verify asks the central solver, which is --protocol central itself",
    ),
    OptionRule(
        lambda o: o.patience is not None and (o.protocol == CENTRAL or o.runtime in _WITHOUT_PROCESSES),
        "--patience is for robots with processes, which can be stopped",
        "drop it",
    ),
    _for_robots("--messages", lambda o: o.messages),
    _for_robots("--ncccs", lambda o: o.ncccs is not None),
    _for_robots("--cycles", lambda o: o.cycles is not None),
    _for_robots("--on-loss", lambda o: o.on_loss),
    _for_robots("--spare", lambda o: o.spares),
    _for_robots("--kill", lambda o: o.kill),
    _for_robots("--channel", lambda o: o.channel),
    _for_robots("--deadline", lambda o: o.deadline),
    _for_robots("--message-loss", lambda o: o.message_loss),
    _for_robots("--filter", lambda o: o.filters),
    _for_robots("--bounds", lambda o: o.bounds),
    _for_robots("--order", lambda o: o.order is not None),
    _for_robots("--set", lambda o: o.settings),
    _for_robots("--preprocess", lambda o: o.preprocess),
    OptionRule(
        lambda o: o.preprocess and o.runtime in {Runtime.NETWORK, Runtime.ARRAYS},
        "--preprocess is of robots in processes or the simulator",
        "drop it",
    ),
    OptionRule(
        lambda o: o.protocol == CENTRAL and o.withdraw is Withdrawal.MAXIMAL,
        "--withdraw maximal is settled by the robots, in priority order; the central solver finds a minimum",
        "--withdraw minimum",
    ),
    OptionRule(
        lambda o: o.central_with != CentralSolverName.ACE and o.protocol != CENTRAL,
        "--with says who decides one model of all files",
        "add --protocol central",
    ),
    OptionRule(
        lambda o: o.central_with == CentralSolverName.ORTOOLS and o.count,
        "--count is of ACE's solutions; OR-Tools does not count",
        "drop --with",
    ),
    OptionRule(
        lambda o: o.count and o.withdraw is not None,
        "--count is of solutions for all robots; --withdraw asks who can do without",
    ),
    OptionRule(
        lambda o: o.filters and o.runtime is not Runtime.NETWORK,
        "--filter is for messages that cross a network",
        "add --runtime network",
    ),
    OptionRule(
        lambda o: o.bounds and o.runtime in {Runtime.NETWORK, Runtime.ARRAYS},
        "--bounds is of robots in processes or the simulator",
        "drop it",
    ),
    OptionRule(
        lambda o: o.spares and o.runtime is Runtime.NETWORK,
        "--spare starts processes of this machine again",
        "drop --runtime network",
    ),
    OptionRule(
        lambda o: (o.on_loss or o.spares) and o.runtime in _WITHOUT_PROCESSES,
        "--on-loss and --spare are for processes, which can die",
        "drop --runtime, or write a scenario.xml",
    ),
    OptionRule(
        lambda o: o.kill and o.runtime in _WITHOUT_PROCESSES,
        "--kill ends a robot's process, and the simulator and arrays have none",
        "drop --runtime",
    ),
    OptionRule(
        lambda o: o.spares and o.on_loss is OnLoss.FAIL,
        "--spare brings robots back that died; --on-loss fail ends the run instead",
    ),
    OptionRule(
        lambda o: o.withdraw is not None and o.protocol != CENTRAL and o.runtime is Runtime.ARRAYS,
        "--withdraw is settled by protocols that have no form as arrays",
        "add --runtime simulator",
    ),
)
"""Combinations of options that are refused for every problem."""

ENVIRONMENT_RULES = (
    _not_while_changing("--protocol central", lambda o: o.protocol == CENTRAL),
    _not_while_changing("--withdraw", lambda o: o.withdraw is not None),
    _not_while_changing("--runtime network", lambda o: o.runtime is Runtime.NETWORK),
    _not_while_changing("--runtime arrays", lambda o: o.runtime is Runtime.ARRAYS),
    _not_while_changing("--preprocess", lambda o: o.preprocess),
)
"""Further combinations that are refused if an environment changes the problem."""


def refuse_options(options: Options, *, environment: bool = False) -> None:
    """Raise `UnsupportedError` for options that do not go together; `environment`: one changes the problem."""
    for rule in (*ENVIRONMENT_RULES * environment, *OPTION_RULES):
        if rule.refuses(options):
            raise UnsupportedError("; ".join(filter(None, [rule.why, rule.instead])))


# Options that do not go with the team


@dataclass(frozen=True)
class Case:
    """A team, the options, and the traits of the protocol."""

    team: Team
    options: Options
    traits: Traits

    @property
    def has_costs(self) -> bool:
        """Return whether the problem has costs."""
        return self.team.kind is ProblemKind.DISWCSP

    @property
    def has_negative_costs(self) -> bool:
        """Return whether something was taken out of costs, so that none is negative."""
        return self.team.told_in.maximize or any(constraint.offset for constraint in self.team.constraints())

    @property
    def is_distributed(self) -> bool:
        """Return whether the robots solve the problem together, without the central solver."""
        return self.options.protocol != CENTRAL

    @property
    def minimum_withdrawal(self) -> bool:
        """Return whether as few robots as possible are to withdraw."""
        return self.is_distributed and self.options.withdraw is Withdrawal.MINIMUM

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

    refuses: Callable[[Case], object]
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
    _not_with_scenario("--runtime network", lambda o: o.protocol != CENTRAL and o.runtime is Runtime.NETWORK),
    _not_with_scenario("--runtime arrays", lambda o: o.protocol != CENTRAL and o.runtime is Runtime.ARRAYS),
    TeamRule(lambda c: c.traits.lacks, "{protocol} needs {case.traits.lacks}"),
    TeamRule(
        lambda c: c.is_distributed and c.options.runtime is Runtime.ARRAYS and not c.traits.arrays,
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
        lambda c: c.has_costs and not c.traits.costs and not c.minimum_withdrawal,
        "{team} is a DisWCSP, and {protocol} does not minimise costs",
        other_protocol=True,
    ),
    TeamRule(
        lambda c: c.options.withdraw is not None and c.has_negative_costs,
        "{team} has negative costs, or utilities; with --withdraw a robot that withdraws would save or lose them",
        "add a constant to the costs of each constraint, so that all are 0 or more and minimised",
    ),
    TeamRule(
        lambda c: c.has_costs and c.options.withdraw is Withdrawal.MAXIMAL,
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
    case = Case(team, options, traits)
    for rule in TEAM_RULES:
        if rule.refuses(case):
            why = rule.why.format(team=team.name, protocol=options.protocol, case=case)
            why = "; ".join(filter(None, [why, rule.instead]))
            raise UnfitProtocolError(why, complete=rule.complete) if rule.other_protocol else UnsupportedError(why)
    for epoch in case.epochs:
        for name, able in _takers(case):
            _refuse_constraints(epoch, name, able)


def _takers(case: Case) -> Iterator[tuple[str, Traits]]:
    """Yield all protocols that must support the constraints: the protocol, and those that take over from it."""
    options, traits = case.options, case.traits
    taken_over = case.minimum_withdrawal and not traits.costs
    if not (taken_over and case.has_costs):  # then soft constraints are left to what takes over
        yield options.protocol, traits
    if taken_over:
        yield "--withdraw minimum", Traits(costs=True)
    if options.withdraw is Withdrawal.MAXIMAL:
        yield "--withdraw maximal", FirstFit.traits
    if options.spares:
        yield "--spare", Traits(costs=True)


def _refuse_constraints(team: Team, name: str, traits: Traits) -> None:
    """Raise `UnfitProtocolError` for constraints that the one called `name` cannot take."""
    for robot in team.robots:
        unmet = unmet_requirement(robot, traits, team.owner)
        if unmet:
            raise UnfitProtocolError(f"{unmet}, which {name} does not support")
    if traits.allocates and (fault := allocation_fault(team, congestion=traits.congestion)):
        raise UnfitProtocolError(f"{team.name} is no task allocation, and {name} takes nothing else: {fault}")


def max_total(team: Team, options: Options) -> float:
    """Return what all costs of `team` could add up to; withdrawal costs are included where robots may withdraw."""
    times = sum(robot.weight for robot in team.robots) + 1 if options.withdraw is not None else 1
    return withdrawal_cost(team) * times
