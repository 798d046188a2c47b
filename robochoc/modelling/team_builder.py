"""Builds the team of a model: the unit of costs, names, the constraints of each robot, and changes over time."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from robochoc.formats import InvalidInputError, check_team
from robochoc.model.assembly import Extras, assemble
from robochoc.model.constraint import Constraint, Domain, Variable
from robochoc.model.cost_units import PLAIN_COSTS, CostUnits
from robochoc.model.finer_units import in_finer_units
from robochoc.model.priorities import priority_order
from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    Change,
    ProblemKind,
    RemoveConstraint,
    Robot,
    ScenarioEvent,
    Team,
)
from robochoc.model.real import RealInterval
from robochoc.model.symbols import symbol_table, with_marked_symbols, with_table_everywhere
from robochoc.modelling.constraints import ModelConstraint
from robochoc.modelling.drafts import Definitions, Draft, costs_of
from robochoc.modelling.errors import ModelError, SourceLine
from robochoc.modelling.events import ModelEvent, Removal
from robochoc.modelling.numbers import places_of
from robochoc.modelling.random_variables import BY_CHANCE
from robochoc.modelling.robots import ModelRobot
from robochoc.modelling.team_contents import changes_in_finer_units
from robochoc.system.suggestions import did_you_mean

if TYPE_CHECKING:
    from robochoc.modelling.model import Model


def build_team(model: Model, order: Sequence[str] | None = None) -> Team:
    """Return the team of a model.

    Args:
        model: The model.
        order: The robots in priority order. None: the order given by the robots' priorities.

    Raises:
        ModelError: if the model is invalid.
        InvalidInputError: if the model is invalid, but not because of a single line in the program.
    """
    try:
        builder = _Builder(model, order)
        team = builder.team()
    except RecursionError:
        raise ModelError("a term of the model is nested too deeply", "replace parts of it by variables") from None
    try:
        check_team(team)
    except InvalidInputError as invalid:
        raise builder.located(invalid) from None
    return team


def saved_order(team: Team) -> tuple[str, ...]:
    """Return the order that the files of `team` give the robots: by links, then by names."""
    return priority_order({robot.name: [parent.name for parent in robot.parents] for robot in team.robots})


class _Builder:
    """Builds one team from a model."""

    def __init__(self, model: Model, order: Sequence[str] | None) -> None:
        self._model = model
        given = model.given
        self._robots = [robot for robot in model.robots.values() if robot.joins is None]
        if not self._robots:
            raise ModelError("the model has no robot", "add one: model.robot(name)")
        rank = {name: place for place, name in enumerate(order or ())}
        self._robots.sort(key=lambda robot: rank.get(robot.name, 0) if order else -robot.priority)
        self._drafts = [draft for rule in model.constraints for draft in rule.drafts()]
        self._drafts += costs_of(model.objective, model.free_prefix("cost"))
        constant = model.constant
        self._parts = {robot.name: self._parts_of(robot) for robot in self._robots}
        self._added = {
            rule: list(rule.drafts())
            for event in model.events
            for rule in event.steps
            if isinstance(rule, ModelConstraint)
        }
        every = [*self._drafts, *(draft for found in (*self._parts.values(), *self._added.values()) for draft in found)]
        soft = model.maximized is not None or any(draft.soft for draft in every)
        self._kind = (
            ProblemKind.DISWCSP if soft or (given and given.kind == ProblemKind.DISWCSP) else ProblemKind.DISCSP
        )
        known = given.units if given else PLAIN_COSTS
        places = max([known.places, places_of(constant), *(draft.places for draft in every)])
        self._finer = 10 ** (places - known.places)
        total = int(constant * 10**places) + known.constant * self._finer
        self._units = CostUnits(bool(model.maximized), places, total)
        self._definitions = Definitions(given.definitions if given else ())
        self._domains: dict[tuple[tuple[range, ...], tuple[str, ...], RealInterval | None], str] = {}
        self._symbols = model.symbols.all
        self._places: dict[str, SourceLine] = {}

    def _parts_of(self, robot: ModelRobot) -> list[Draft]:
        """Return the drafts of a robot's parts of shared constraints; drafts over its own variables become private."""
        found = []
        for draft in (one for rule in robot.parts for one in rule.drafts()):
            owners = {variable.owner for variable in draft.scope}
            if BY_CHANCE in owners:
                message = f"the part known to {robot.name} depends on a random variable"
                raise ModelError(message, "add it as a constraint that both robots know: Model.add", draft.place)
            if owners <= {robot.name}:
                self._drafts.append(draft)
            elif robot.name in owners:
                found.append(draft)
            else:
                message = f"the part known to {robot.name} is over variables of {' and '.join(owners)} alone"
                raise ModelError(message, "add it as a constraint of that robot: Model.add", draft.place)
        return found

    def team(self) -> Team:
        """Return the team with its scenario."""
        given, minimised = self._model.given, self._model.objective
        constraints = [self._finished(draft) for draft in self._drafts]
        parts = {name: [self._finished(draft) for draft in drafts] for name, drafts in self._parts.items()}
        if given:
            constraints = [*(in_finer_units(one, self._finer) for one in given.constraints), *constraints]
            for name, raw in given.parts.items():
                parts[name] = [*(in_finer_units(one, self._finer) for one in raw), *parts[name]]
        team = assemble(
            self._model.name,
            {robot.name: self._variables(robot) for robot in self._robots},
            constraints,
            kind=self._kind,
            costs=self._units,
            extras=Extras(
                links=given.links if given else (),
                topics={robot.name: robot.topics for robot in self._robots},
                weights={robot.name: robot.weight for robot in self._robots},
                parts=parts,
                random=self._model.random_variables,
                objectives=[*(given.objectives if given else ()), *filter(None, (one.objective for one in minimised))],
            ),
        )
        whole = replace(team, scenario=self._scenario(team))
        return with_table_everywhere(whole, symbol_table(team.robots)) if self._model.events else whole

    def _finished(self, draft: Draft) -> Constraint:
        if draft.scope and all(variable.owner == BY_CHANCE for variable in draft.scope):
            names = " and ".join(variable.name for variable in draft.scope)
            raise ModelError(f"{draft.name} is over {names} only, which no robot decides", "leave it out", draft.place)
        made = self._definitions.constraint(draft, self._units.places, -1 if self._units.maximize else 1)
        for name in (made.name, made.definition.name):
            self._places.setdefault(name, draft.place)
        return made

    def located(self, invalid: InvalidInputError) -> Exception:
        """Return the first error of a team with its line in the program, or `invalid` itself if no line is known."""
        for mistake in invalid.diagnostics:
            named = re.search(r"\b(?:constraint|predicate|relation|function) (\S+?)(?: |$)", mistake.file)
            if named and named[1] in self._places:
                return ModelError(f"{mistake.file}: {mistake.message}", mistake.hint, self._places[named[1]])
        return invalid

    def _variables(self, robot: ModelRobot) -> list[Variable]:
        if not robot.variables:
            raise ModelError(f"{robot.name} has no variable", "a robot needs at least one", robot.place)
        found = []
        for variable in robot.variables.values():
            symbols = self._symbols if variable.codes.symbolic else ()
            key = variable.codes.ranges, symbols, variable.codes.real
            name = variable.domain_name or self._domains.setdefault(key, f"D{len(self._domains) + 1}")
            found.append(Variable(variable.name, Domain(name, *key)))
        return found

    def _scenario(self, team: Team) -> tuple[ScenarioEvent, ...]:
        given = self._model.given
        events = [
            replace(event, changes=changes_in_finer_units(event.changes, self._finer))
            for event in (given.events if given else ())
        ]
        order = [*team.order, *(c.robot.name for event in events for c in event.changes if isinstance(c, AddAgent))]
        held = {
            (one.name, robot.name, parent.name)
            for robot in team.robots
            for parent in robot.parents
            for one in parent.constraints
        }
        held |= {(part.name, child.name, robot.name) for robot in team.robots for child in robot.children
                 for part in child.constraints}  # fmt: skip
        changing = _Changing(self, order, held)
        return (*events, *(ScenarioEvent(tuple(changing.changes(event)), event.after) for event in self._model.events))

    def finished_rule(self, rule: ModelConstraint) -> list[Constraint]:
        """Return the team's constraints for a constraint that an event adds."""
        symbolic = [variable.name for variable in self._model.variables.values() if variable.codes.symbolic]
        return with_marked_symbols([self._finished(draft) for draft in self._added[rule]], symbolic)

    def joining(self, robot: ModelRobot, order: Sequence[str], constraints: Iterable[Constraint]) -> Robot:
        """Return a robot that joins after the robots in `order`, with its constraints."""
        everybody = {name: self._variables(self._model.robots[name]) for name in order if name in self._model.robots}
        extras = Extras(
            links=[*itertools.pairwise(everybody)],  # keeps the order of robots without common constraints
            topics={robot.name: robot.topics},
            weights={robot.name: robot.weight},
        )
        everybody[robot.name] = self._variables(robot)
        costs = replace(self._units, constant=0)
        team = assemble("", everybody, constraints, kind=self._kind, costs=costs, extras=extras)
        return replace(team[robot.name], children=())

    def owners(self, constraint: Constraint, order: Sequence[str]) -> list[str]:
        """Return the robots in a constraint's scope, the highest priority first."""
        owners = {self._model.variables[name].owner for name in constraint.variables}
        return [name for name in order if name in owners]

    @property
    def rules(self) -> list[ModelConstraint]:
        """The constraints before the first event."""
        return [*self._model.constraints, *(part for robot in self._robots for part in robot.parts)]

    def shared_by(self, rule: ModelConstraint, order: Sequence[str]) -> set[tuple[str, str, str]]:
        """Return, for each constraint that `rule` becomes, its name and the two robots that share it."""
        scopes = [{variable.owner for variable in draft.scope} for draft in rule.drafts()]
        robots = [[name for name in order if name in scope] for scope in scopes]
        return {(rule.name, names[-1], names[-2]) for names in robots if len(names) > 1}


class _Changing:
    """The robots and the constraints between them, updated by each event.

    `held`: each constraint's name with the two robots that share it.
    """

    def __init__(self, builder: _Builder, order: list[str], held: set[tuple[str, str, str]]) -> None:
        self._builder = builder
        self._order = order
        self._held = held
        self._rules = builder.rules

    def changes(self, event: ModelEvent) -> Iterable[Change]:
        """Yield the changes of an event."""
        new = {robot.name: list[Constraint]() for robot in event.steps if isinstance(robot, ModelRobot)}
        self._order += new
        added: dict[ModelConstraint, list[AddConstraint]] = {}
        for rule in (step for step in event.steps if isinstance(step, ModelConstraint)):
            added[rule] = self._added(rule, new)
        for step in event.steps:
            if isinstance(step, ModelRobot):
                before = self._order[: self._order.index(step.name)]
                yield AddAgent(self._builder.joining(step, before, new[step.name]))
            elif isinstance(step, ModelConstraint):
                self._held |= self._builder.shared_by(step, self._order)
                self._rules.append(step)
                yield from added[step]
            elif isinstance(step, Removal):
                yield from self._removed(step)
            else:
                yield step

    def _added(self, rule: ModelConstraint, new: dict[str, list[Constraint]]) -> list[AddConstraint]:
        """Return the constraints added between robots of the team; those of joining robots are stored in `new`."""
        found = []
        for constraint in self._builder.finished_rule(rule):
            if not constraint.variables and not constraint.price({}):
                continue
            if not constraint.variables:
                hint = "an event adds constraints between robots: add it to the model"
                raise ModelError(f"the constraint {rule.name} is always violated", hint, rule.place)
            *others, lowest = self._builder.owners(constraint, self._order)
            if lowest in new:
                new[lowest].append(constraint)
            elif not others:
                hint = "an event can add constraints between robots, but only values to one robot"
                raise ModelError(f"the constraint {rule.name} is over variables of {lowest} alone", hint, rule.place)
            else:
                found.append(AddConstraint(lowest, others[-1], constraint))
        return found

    def _removed(self, removal: Removal) -> Iterable[RemoveConstraint]:
        found = {one for one in self._held if one[0] == removal.name}
        there = [one for one in self._rules if one.name == removal.name]
        if isinstance(removal.removed, ModelConstraint):
            found &= self._builder.shared_by(removal.removed, self._order)
            for other in (one for one in there if one is not removal.removed):
                if self._builder.shared_by(other, self._order) & found:
                    hint = "give it another name: an event removes a constraint by its name and robots"
                    raise ModelError(
                        f"{removal.removed!r} has the same name and robots as {other!r}", hint, removal.place
                    )
            there = [removal.removed]
        if not found:
            hint = did_you_mean(
                removal.name, {one[0] for one in self._held}, "events remove constraints between robots"
            )
            raise ModelError(f"robots share no constraint {removal.name!r} at that time", hint, removal.place)
        self._held -= found
        self._rules = [one for one in self._rules if not any(one is removed for removed in there)]
        for name, agent, parent in sorted(found):
            yield RemoveConstraint(agent, parent, name)
