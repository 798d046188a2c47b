"""Runs of teams with several objectives: as runs of teams with a single cost (`solver/objectives.py`).

A weighted or lexicographic sum is an ordinary cost. For the Pareto front, robots get packed costs, and a protocol that
finds fronts. Afterwards, the costs in each objective are computed from the files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from fractions import Fraction
from itertools import accumulate
from typing import NamedTuple, TypeVar

from robochoc.formats import InvalidInputError, check_team
from robochoc.formats.diagnostics import shortened
from robochoc.model.change import team_after_events
from robochoc.model.cost_units import Cost
from robochoc.model.objectives import PARETO, Combination, ObjectivesMode
from robochoc.model.outcome import Answer, EpochOutcome, FrontPoint, Outcome, Verdict
from robochoc.model.problem import ScenarioEvent, Team
from robochoc.run.defaults import AUTO, CENTRAL, FRONT_PROTOCOL
from robochoc.run.options import OnLoss, Options, Runtime
from robochoc.run.registry import protocol_named
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.objectives import (
    combined,
    lexicographic_bases,
    lexicographic_weights,
    refuse_excess,
    with_all_solutions,
)
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.plain_text import listed
from robochoc.verification.checker import objective_costs, robots_without_values
from robochoc.verification.front import MOST_ASSIGNMENTS, assignments_of, check_front, confirm_front, enumerated_front

_Answer = TypeVar("_Answer", EpochOutcome, Outcome)


class FrontRule(NamedTuple):
    """An option that is refused for a Pareto front: the condition and the option."""

    refuses: Callable[[Options], object]
    option: str


FRONT_RULES = (
    FrontRule(lambda o: o.withdraw is not None, "--withdraw"),
    FrontRule(lambda o: o.spares or o.on_loss == OnLoss.WITHDRAW, "--spare and --on-loss withdraw"),
    FrontRule(lambda o: o.deadline is not None, "--deadline"),
    FrontRule(lambda o: o.count, "--count"),
    FrontRule(lambda o: o.start, "--start"),
    FrontRule(lambda o: o.message_loss or (o.channel and o.channel.most_loss), "--message-loss"),
    FrontRule(lambda o: o.standby, "--standby"),
    FrontRule(lambda o: o.runtime == Runtime.ARRAYS, "--runtime arrays"),
)


@dataclass(frozen=True)
class CombinedRun:
    """A run of a team with several objectives as a team with a single cost.

    Attributes:
        original: The team with its objectives.
        mode: The treatment of the objectives.
        weights: The factor of each objective in the single cost.
        team: The team with a single cost.
        options: The options for that team.
    """

    original: Team
    mode: ObjectivesMode
    weights: Mapping[str, int]
    team: Team
    options: Options

    @property
    def is_central_front(self) -> bool:
        """Return whether the front is enumerated, after the central solver has found its first point."""
        return self.options.protocol == CENTRAL and self.mode.combination == Combination.PARETO

    @property
    def is_packed(self) -> bool:
        """Return whether costs in the run are packed vectors, which are not costs of the user."""
        return self.mode.combination != Combination.WEIGHTED

    def after(self, added: Iterable[ScenarioEvent]) -> CombinedRun:
        """Return this run with the events that an environment has added to the scenario."""
        return replace(self, original=replace(self.original, scenario=(*self.original.scenario, *added)))

    def outcome(self, outcome: Outcome) -> Outcome:
        """Return `outcome`, of the team with a single cost, with the costs in each objective.

        Raises:
            RefutedError: if the checker refutes a point of the front.
        """
        if self.is_central_front and outcome.verdict == Verdict.OPTIMAL:
            outcome = _with_enumerated_front(self, outcome)
        events = accumulate((not epoch.lost for epoch in outcome.epochs), initial=0)
        epochs = tuple(
            [self._with_objectives(epoch, number) for epoch, number in zip(outcome.epochs, events, strict=False)]
        )
        found = replace(self._with_objectives(outcome, outcome.events), epochs=epochs)
        if self.is_packed:
            found = replace(found, stages=tuple([one._replace(cost=None) for one in outcome.stages]))
        if not outcome.front:
            return found
        front = tuple(
            [FrontPoint(objective_costs(self.original, one.assignment), one.assignment) for one in found.front]
        )
        check_front(self.original, front)
        wanted = self.options.verify and not self.is_central_front  # other solvers have confirmed the first point only
        is_confirmed = wanted and confirm_front(self.original, [one.objectives for one in front])
        return replace(found, front=front, confirmed=is_confirmed, confirmed_by=(ENUMERATION,) if is_confirmed else ())

    def _with_objectives(self, answer: _Answer, events: int) -> _Answer:
        """Return an answer, after this number of events, with the costs in each objective, if they are known."""
        if not answer.assignment:
            return replace(answer, bound=None) if self.is_packed else answer
        costs = self._costs(answer, events)
        if not self.is_packed:
            return replace(answer, objectives=costs)
        first = (self.mode.order or self.original.objectives)[0]
        return replace(answer, objectives=costs, cost=costs.get(first), bound=None)

    def _costs(self, answer: Answer, events: int) -> dict[str, Cost]:
        """Return the cost of an answer in each objective; empty if they do not add up to the cost in the run.

        This is the case if constraints were lost with the robots that held them, or if an environment adds costs, which
        belong to no objective.
        """
        now = team_after_events(self.original, events)
        costs = objective_costs(now, answer.assignment, robots_without_values(now, answer.assignment))
        total = sum(self.weights[name] * Fraction(cost) for name, cost in costs.items())
        return costs if answer.cost is None or total == Fraction(answer.cost) else {}


ENUMERATION = "enumeration"


def combined_run(team: Team, options: Options, *, environment: bool = False) -> CombinedRun | None:
    """Return the run of `team` with a single cost; None if the team has no objectives.

    Args:
        team: The valid team.
        options: How to run.
        environment: True if an environment changes the problem.

    Raises:
        UnsupportedError: if the options cannot be combined with the objectives of the team.
    """
    if not team.objectives:
        if options.objectives is not None:
            why = "has a single cost" if team.kind == "DisWCSP" else "has no costs"
            raise UnsupportedError(f"{team.name} {why}; --objectives is for teams with several: remove it")
        return None
    if any(robot.random for robot in team.robots):
        raise UnsupportedError(
            f"{team.name} has random variables, and several objectives are not possible there: use a single cost"
        )
    mode = options.objectives or _default_mode(team, options)
    if mode.combination == Combination.PARETO:
        return _front_run(team, options, environment=environment)
    if mode.combination == Combination.LEXICOGRAPHIC and options.improve:
        raise UnsupportedError("--improve cannot be combined with --objectives lexicographic: choose weighted")
    if options.spares:
        raise UnsupportedError(
            "--spare cannot be combined with several objectives, since a robot that comes back reads its own file, in"
            " which they are not combined: robochoc export --objectives writes a problem with a single cost"
        )
    weights = _weights(team, mode)
    return CombinedRun(team, mode, weights, _single_cost(team, weights), replace(options, objectives=mode))


def with_single_cost(team: Team, mode: ObjectivesMode) -> Team:
    """Return `team` with the weighted or lexicographic sum of its objectives as the cost. Raises `UnsupportedError`."""
    return _single_cost(team, _weights(team, mode))


def _weights(team: Team, mode: ObjectivesMode) -> dict[str, int]:
    """Return the factor of each objective in the weighted or lexicographic sum. Raises `UnsupportedError`."""
    if mode.combination == Combination.PARETO or not team.objectives:
        raise UnsupportedError(
            f"{team.name} has a single cost: remove --objectives"
            if not team.objectives
            else "a Pareto front is not a single cost: choose --objectives weighted:... or lexicographic:..."
        )
    if {*mode.names} != {*team.objectives}:
        names = ", ".join(team.objectives)
        raise UnsupportedError(
            f"{team.name} has the objectives {names}, and --objectives {shortened(str(mode))} does not name exactly"
            " these: name each"
        )
    if mode.combination == Combination.LEXICOGRAPHIC:
        return lexicographic_weights(mode.order, lexicographic_bases(team, mode.order))
    return dict(mode.weights)


def _default_mode(team: Team, options: Options) -> ObjectivesMode:
    """Return the mode if `options` name none. Raises `UnsupportedError` if the protocol finds no fronts."""
    if options.protocol in {AUTO, CENTRAL} or protocol_named(options.protocol).traits.fronts:
        return PARETO
    raise _no_front(team, options.protocol)


def _no_front(team: Team, protocol: str) -> UnsupportedError:
    weights = ",".join(f"{name}=1" for name in team.objectives)
    order, names = ",".join(team.objectives), ", ".join(team.objectives)
    return UnsupportedError(
        f"{team.name} has several objectives ({names}), and {protocol} minimises a single cost: add"
        f" --objectives weighted:{weights} or --objectives lexicographic:{order}, or use the protocol {FRONT_PROTOCOL}"
    )


def _front_run(team: Team, options: Options, *, environment: bool) -> CombinedRun:
    """Return the run that finds the Pareto front of `team`. Raises `UnsupportedError`."""
    refused = [rule.option for rule in FRONT_RULES if rule.refuses(options)]
    if refused or team.dynamic or environment:
        option = refused[0] if refused else "a problem that changes"
        raise UnsupportedError(
            f"{option} cannot be combined with a Pareto front: add --objectives weighted:... or lexicographic:..."
        )
    if options.protocol == AUTO:
        names = listed(team.objectives)
        chosen = {"protocol": f"there are several objectives ({names}), and it finds their Pareto front"}
        options = replace(options, protocol=FRONT_PROTOCOL, chosen=chosen)
    if options.protocol != CENTRAL and not protocol_named(options.protocol).traits.fronts:
        raise _no_front(team, options.protocol)
    order = team.objectives
    bases = lexicographic_bases(team, order)
    weights = lexicographic_weights(order, bases)
    single = _single_cost(team, weights)
    if options.protocol != CENTRAL:
        options = replace(options, settings={**options.settings, "bases": ",".join(map(str, bases))})
    elif assignments_of(team) > MOST_ASSIGNMENTS:
        raise UnsupportedError(
            f"{team.name} has {assignments_of(team):,} assignments, and --protocol central finds a Pareto front by"
            f" enumerating at most {MOST_ASSIGNMENTS:,}: choose --protocol {FRONT_PROTOCOL}"
        )
    return CombinedRun(team, PARETO, weights, with_all_solutions(single), replace(options, objectives=PARETO))


def _single_cost(team: Team, weights: Mapping[str, int]) -> Team:
    """Return the valid team with a single cost. Raises `UnsupportedError` if its costs could be too large."""
    refuse_excess(team, weights)
    single = combined(team, weights)
    try:
        check_team(single)
    except InvalidInputError as invalid:
        raise UnsupportedError(f"the combined costs of {team.name} are too large: {invalid}") from None
    return single


def _with_enumerated_front(run: CombinedRun, outcome: Outcome) -> Outcome:
    """Return `outcome`, whose assignment is the first point of the front, with all points by enumeration."""
    _, *others = enumerated_front(run.original).values()
    return replace(outcome, front=tuple([FrontPoint({}, one) for one in (outcome.assignment, *others)]))
