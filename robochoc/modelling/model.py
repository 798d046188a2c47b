"""`robochoc.Model`: a problem for a team of robots, written in Python.

    >>> import robochoc
    >>> model = robochoc.Model("charging")
    >>> slots = [model.robot(f"drone{i}").variable("slot", range(1, 4)) for i in range(3)]
    >>> model.add(robochoc.all_different(slots))
    <C1: all_different(drone0.slot, drone1.slot, drone2.slot)>
    >>> model.minimize(sum(abs(slot - 2) for slot in slots))
    >>> outcome = model.solve("dpop", runtime="simulator")
    >>> outcome.cost
    2

Each robot knows only the content of its own file. Shared constraints, parents and children are derived from the model.
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

from robochoc.formats import InvalidInputError, encodable, read_team, write_team
from robochoc.formats.diagnostics import Diagnostic
from robochoc.model.constraint import WhenAbsent
from robochoc.model.cost_units import PLAIN_COSTS
from robochoc.model.outcome import Outcome
from robochoc.model.problem import Team
from robochoc.model.random_variable import RandomVariable
from robochoc.modelling.codes import Symbols
from robochoc.modelling.constraints import (
    ModelConstraint,
    absence_or_none,
    check_owned,
    conditions_in,
    exact_or_none,
    objective_name,
)
from robochoc.modelling.drafts import ObjectiveTerm, split
from robochoc.modelling.errors import ModelError, ModelTypeError, SourceLine, UnknownNameError, calling_line
from robochoc.modelling.events import ModelEvent
from robochoc.modelling.numbers import Exact, check_places, whole_number
from robochoc.modelling.option_names import errors_in_python
from robochoc.modelling.random_variables import random_variable, with_decisions
from robochoc.modelling.robots import ModelRobot, check_robot
from robochoc.modelling.solution import NamedValues, Solution, UserValues, team_name
from robochoc.modelling.solving import Solvable
from robochoc.modelling.start_values import start_values
from robochoc.modelling.team_builder import build_team, saved_order
from robochoc.modelling.team_contents import TeamContents, contents_of, model_variable
from robochoc.modelling.terms import ModelVariable, all_of, number
from robochoc.run.defaults import CENTRAL
from robochoc.solver.agent_problem import StartValues
from robochoc.system.plain_text import counted
from robochoc.system.suggestions import did_you_mean


class Model(Solvable):
    """A problem written in Python: robots with variables, constraints, costs, and changes over time."""

    def __init__(self, name: str = "model") -> None:
        self._name = name
        self._robots: dict[str, ModelRobot] = {}
        self._variables: dict[str, ModelVariable] = {}
        self._constraints: list[ModelConstraint] = []
        self.symbols = Symbols()
        self._events: list[ModelEvent] = []
        self._objective: list[ObjectiveTerm] = []
        self.constant: Exact = 0
        self.maximized: bool | None = None
        self.random_variables: list[RandomVariable] = []
        self.given: TeamContents | None = None
        self.imported: Mapping[str, str] = {}
        self._team: Team | None = None
        self._named = 0

    @classmethod
    def load(cls, folder: Path | str) -> Model:
        """Return a model of the team whose files are in `folder`. The model can be extended.

        Raises:
            InvalidInputError: if the files are invalid.
        """
        with errors_in_python(("format",)):
            return cls.of(read_team(Path(folder)))

    @classmethod
    def of(cls, team: Team) -> Model:
        """Return a model of a team. The model can be extended."""
        model = cls(team.name)
        model.given = contents_of(team)
        model.maximized = model._given_sense()
        place = calling_line()
        for robot in team.robots:
            added = model.add_robot(robot.name, 0, robot.weight, place)
            added.add_topics(*robot.topics)
            for variable in robot.variables:
                made = model_variable(variable, robot.name, model.symbols, place)
                added.add_variable(variable.name, made)
        return model

    # Read-only views: a change made through them would not reach the team.

    @property
    def name(self) -> str:
        """The name of the model and of its team."""
        return self._name

    @name.setter
    def name(self, name: str) -> None:
        self._name = name
        self.changed()

    @property
    def robots(self) -> Mapping[str, ModelRobot]:
        """The robots, by name."""
        return MappingProxyType(self._robots)

    @property
    def variables(self) -> Mapping[str, ModelVariable]:
        """The variables of all robots, by their names in the team."""
        return MappingProxyType(self._variables)

    @property
    def constraints(self) -> tuple[ModelConstraint, ...]:
        """The constraints in the order in which they were added, without the removed ones."""
        return tuple(self._constraints)

    @property
    def events(self) -> tuple[ModelEvent, ...]:
        """The events, in order."""
        return tuple(self._events)

    @property
    def objective(self) -> tuple[ObjectiveTerm, ...]:
        """The terms of the minimised or maximised sum: each with its factor and the line that added it."""
        return tuple(self._objective)

    def robot(self, name: str, *, priority: float = 0, weight: int = 1) -> ModelRobot:
        """Add a robot.

        Args:
            name: The robot's name.
            priority: Robots with a higher priority come first. Robots with the same priority follow the order of
                creation.
            weight: The weight of the robot's withdrawal: a robot of weight 3 counts as much as three of weight 1.

        Raises:
            ModelError: if the name is invalid, or already used by another robot.
        """
        return self.add_robot(check_robot(name, self.robots, weight), priority, weight, calling_line())

    def add_robot(self, name: str, priority: float, weight: int, place: SourceLine) -> ModelRobot:
        """Add a robot whose name is valid and free. See `robot`."""
        self._robots[name] = ModelRobot(self, name, priority, weight, place)
        self.changed()
        return self._robots[name]

    def add_variable(self, variable: ModelVariable) -> None:
        """Add a variable; its name must be free. See `ModelRobot.variable`."""
        self._variables[variable.name] = variable
        self.changed()

    def random(self, name: str, distribution: object, *, seen_by: Iterable[ModelVariable] = ()) -> ModelVariable:
        """Add a random variable: a number drawn by chance, independently of other random variables.

        Constraints and costs may contain it, besides a variable of a robot. `solve` then minimises the expected cost,
        or with `risk="worst"` the cost in the worst case.

        Args:
            name: The name, unique in the model.
            distribution: The probability of each outcome, an integer: `{0: 0.7, 3: 0.3}`. Probabilities are exact
                decimals.
            seen_by: The variables whose values are chosen after the outcome was observed. In a solution such a variable
                has a value for each outcome, `relay.wind.0` and `relay.wind.3`.

        Returns:
            The random variable: a term in constraints and costs.

        Raises:
            ModelError: if an argument is invalid.
        """
        made, declared = random_variable(name, distribution, seen_by, self.variables, calling_line())
        self.random_variables.append(declared)
        self.add_variable(made)
        return made

    def __getitem__(self, name: str) -> ModelVariable:
        """Return the variable named `name` in the team, such as `drone3.slot`. `name` may also be a CPMpy variable."""
        name = team_name(name, self.imported)
        if name not in self.variables:
            raise UnknownNameError(f"there is no variable {name!r}", did_you_mean(name, self.variables))
        return self.variables[name]

    def _ipython_key_completions_(self) -> list[str]:
        return [*self.variables]

    def add(
        self,
        *constraints: object,
        cost: object = None,
        name: str | None = None,
        when_absent: WhenAbsent | str | None = None,
        objective: str = "",
    ) -> ModelConstraint:
        """Add constraints. Constraints between variables of a single robot are private: no other robot learns them.

        Args:
            *constraints: Conditions, or lists of them.
            cost: The cost of violating the constraints; it is due once, if at least one of them does not hold. If a sum
                is maximised, the cost is subtracted from it. None, or `math.inf`: the constraints are hard.
            name: A name by which an event can remove the constraints.
            when_absent: The meaning of the constraints when a robot in their scopes withdraws, is lost or leaves:
                `restate` them for the other robots, `drop` them, or `fail`. None: the default for their form
                (documentation, page When a robot is absent).
            objective: The objective to which the cost belongs, if the model has several objectives (see `minimize`).

        Returns:
            A single constraint: the conjunction of all `constraints`.

        Raises:
            ModelError: if a constraint is not a condition over variables of this model, or cannot be restated.
        """
        rule = self.rule(constraints, cost, name, when_absent=when_absent, objective=objective)
        self._constraints.append(rule)
        self.changed()
        return rule

    def remove(self, constraint: ModelConstraint) -> None:
        """Remove a constraint that `add` or a robot's `knows` returned. Other constraints with the same name remain.

        Raises:
            ModelError: if the model does not contain the constraint, or if an event adds the constraint.
        """
        if any(one is constraint for one in self._constraints):
            self._constraints.remove(constraint)
            self.changed()
            return
        for robot in self._robots.values():
            if any(one is constraint for one in robot.parts):
                robot.remove_part(constraint)
                return
        raise ModelError(f"{constraint!r} is not a constraint of {self!r}", "use a result of add()")

    def __iadd__(self, constraints: object) -> Self:
        """Add constraints, as `add` does."""
        self.add(constraints)
        return self

    def minimize(self, costs: object, *, places: int | None = None, objective: str = "") -> None:
        """Minimise a sum of terms. The sums of repeated calls are added up.

        Terms over the same variables become one cost function. Integers, `Decimal` and `Fraction` are exact; a float
        has the value of its decimal text, so 0.1 is one tenth.

        Args:
            costs: The sum.
            places: The number of decimal places (0 to 9) to which each cost is rounded, for distances and other real
                numbers. None: costs are exact, and costs with more than 9 places are rejected.
            objective: The name of the objective to which the sum belongs, if the model has two or three objectives.
                Then each cost of the model belongs to an objective, and `solve` returns the Pareto front.

        Raises:
            ModelError: if the sum is not a number, or another sum of the model is maximised.
        """
        self._optimize(costs, places, objective, maximize=False)

    def maximize(self, utilities: object, *, places: int | None = None, objective: str = "") -> None:
        """Maximise a sum of terms; see `minimize`. The costs of violated soft constraints are subtracted."""
        self._optimize(utilities, places, objective, maximize=True)

    def _optimize(self, given: object, places: int | None, objective: str, *, maximize: bool) -> None:
        place = calling_line()
        if self.maximized not in {None, maximize}:
            words = ("minimised", "maximised")
            raise ModelError(
                f"a sum is {words[maximize]} here, and another sum of the model is {words[not maximize]}",
                "change the sign of one sum, and minimise or maximise both",
            )
        term = number(given)
        check_owned(term, self.variables, place)
        name = objective_name(objective, place)
        parts, constant = split(term, place, check_places(places), name)
        if name and constant:
            raise ModelError("the sum of an objective has a constant", "leave it out: it changes no choice", place)
        self._objective += parts
        self.constant += constant
        self.maximized = maximize
        self.changed()

    def rule(
        self,
        constraints: object,
        cost: object,
        name: str | None,
        event: object = None,
        when_absent: WhenAbsent | str | None = None,
        objective: str = "",
    ) -> ModelConstraint:
        """Return a constraint without adding it."""
        place = calling_line()
        term = all_of(conditions_in(constraints, place))
        check_owned(term, self.variables, place, event)
        absence = absence_or_none(when_absent, place)
        price, objective = exact_or_none(cost), objective_name(objective, place)
        if objective and price is None:
            message = f"a hard constraint belongs to the objective {objective}"
            raise ModelError(message, "add a cost, or leave the objective out", place)
        rule = ModelConstraint(name or self._free_name(), term, price, place, absence, objective)
        if absence == WhenAbsent.RESTATE:
            list(rule.drafts())
        return rule

    @property
    def rules(self) -> tuple[ModelConstraint, ...]:
        """All constraints: the model's constraints, the parts known by robots, and the constraints added by events."""
        parts = [part for robot in self._robots.values() for part in robot.parts]
        later = [step for event in self._events for step in event.steps if isinstance(step, ModelConstraint)]
        return (*self._constraints, *parts, *later)

    def free_prefix(self, prefix: str) -> str:
        """Return `prefix`, extended by `_` until no constraint's name begins with it."""
        taken = {rule.name for rule in self.constraints} | (self.given.names if self.given else set())
        while any(name.startswith(prefix) for name in taken):
            prefix += "_"
        return prefix

    def _free_name(self) -> str:
        taken = {rule.name for rule in self.constraints} | (self.given.names if self.given else set())
        self._named = next(number for number in itertools.count(self._named + 1) if f"C{number}" not in taken)
        return f"C{self._named}"

    def after_solution(self) -> ModelEvent:
        """Add an event whose changes happen as soon as the current problem is solved."""
        return self._event(None)

    def after_messages(self, count: int) -> ModelEvent:
        """Add an event whose changes happen after `count` messages, or earlier if the current problem is solved."""
        whole = whole_number(count)
        if whole is None or whole < 0:
            raise ModelTypeError(f"{count!r} is not a number of messages", "expected an integer, 0 or more")
        return self._event(whole)

    def _event(self, after: int | None) -> ModelEvent:
        self._events.append(ModelEvent(self, after, calling_line()))
        self.changed()
        return self._events[-1]

    def changed(self) -> None:
        """Discard the cached team: the model has changed."""
        self._team = None

    @property
    def team(self) -> Team:
        """The team of the model's current state. Raises `ModelError` if the model is invalid."""
        if self._team is None:
            self._team = build_team(self)
        return self._team

    def values_of(self, assignment: Mapping[str, int]) -> NamedValues:
        """Return the user's values for the integers in an assignment, such as that of an event or an epoch."""
        return UserValues(with_decisions(self._variables, self.random_variables), None)(assignment)

    def solutions(self, protocol: str = CENTRAL, *, limit: int | None = None, **options: Any) -> Iterator[Solution]:  # noqa: ANN401 - those of `solve`
        """Yield all solutions one by one, the cheapest first if costs are minimised.

        Searches start when their solutions are requested. Solutions differ in at least one value. `central` lists many
        solutions in one search, and sorts up to 100,000 solutions with costs; for more, and for other protocols,
        a `central_with` other than ACE, or a `journal`, each solution is a search. `timeout` limits each search.

        Args:
            protocol: The protocol, or `central`: a single solver that knows the constraints of all robots.
            limit: The maximum number of solutions. None: all solutions.
            **options: The other options of `solve`, except `withdraw`.

        Raises:
            ExplorationError: if a search ends without a verdict, at a limit or because the protocol is incomplete.
            UnsupportedError: if events change the model.
            OptionError: if the robots may withdraw.

        Example:
            >>> model = robochoc.Model()
            >>> x = model.robot("r1").variable("x", range(3))
            >>> [solution[x] for solution in model.solutions()]
            [0, 1, 2]
        """
        from robochoc.modelling.exploration import solutions_of  # noqa: PLC0415 - start-up: seldom used

        return solutions_of(self, protocol, limit, options)

    def conflict(self, *, timeout: float | None = None) -> tuple[ModelConstraint, ...] | None:
        """Return a minimal set of constraints that cannot hold together: if any one of them is removed, the others can.

        The set is empty if a robot has a variable without values. The result is None if all hard constraints can hold
        together.

        Args:
            timeout: A time limit, in seconds. None: no limit.

        Raises:
            ExplorationError: if the time limit was reached.
            UnsupportedError: if the model was loaded, or events change it.
        """
        from robochoc.modelling.exploration import conflict_of  # noqa: PLC0415 - start-up: seldom used

        return conflict_of(self, timeout)

    def _given_sense(self) -> bool | None:
        """Return whether the costs of the given team are maximised; None if the team has no costs."""
        units = self.given.units if self.given else PLAIN_COSTS
        return units.maximize if units != PLAIN_COSTS else None

    def clear_objective(self) -> None:
        """Remove all costs added by `minimize` or `maximize`."""
        self._objective.clear()
        self.constant = 0
        self.maximized = self._given_sense()
        self.changed()

    def save(self, folder: Path | str, *, replace: bool = False) -> None:
        """Write the robots' files, and `scenario.xml` if there are events. Either all files are written, or none.

        Args:
            folder: The folder to write. Its name becomes the team's name when the files are read.
            replace: True to replace an existing team.

        Raises:
            ModelError: if the model is invalid.
            InvalidInputError: if the files cannot express the model, or the folder exists and `replace` is false.
            OSError: if the folder cannot be written.
        """
        team, order = self.team, saved_order(self.team)
        if team.order != order:
            team = build_team(self, order)
        if not replace and Path(folder).exists():
            hint = "choose another folder, or replace this one: save(folder, replace=True)"
            raise InvalidInputError([Diagnostic(encodable(str(folder)), 0, "the folder exists already", hint)])
        write_team(team, Path(folder), replace=replace)

    def _repr_html_(self) -> str:
        from robochoc.modelling.html_tables import heading  # noqa: PLC0415 - notebooks only
        from robochoc.modelling.team_html import team_html  # noqa: PLC0415 - notebooks only

        try:
            team = self.team
        except (ModelError, InvalidInputError) as unfinished:
            return heading(repr(self), str(unfinished))
        coded = {name: one.domain for name, one in self.variables.items() if one.codes.user_values is not None}
        return team_html(team, coded)

    def _team_to_solve(self) -> Team:
        return self.team

    def _start_values(self, start: object, team: Team) -> StartValues:
        return start_values(start, team, {}, self.variables, lambda key: team_name(key, self.imported))

    @property
    def _is_ordered(self) -> bool:
        return self.given is not None or any(robot.priority for robot in self.robots.values())

    def _solution(self, outcome: Outcome, team: Team) -> Solution:
        return Solution.of(outcome, team, with_decisions(self.variables, self.random_variables), self.imported)

    def __copy__(self) -> Self:
        """Return an independent copy."""
        return copy.deepcopy(self)

    def __getstate__(self) -> dict[str, object]:
        """Return the state without the cached team."""
        return {**vars(self), "_team": None}

    def __repr__(self) -> str:
        robots, variables = counted(len(self.robots), "robot"), counted(len(self.variables), "variable")
        constraints = len(self.constraints) + (self.given.number if self.given else 0)
        return f"<model {self.name}: {robots}, {variables}, {counted(constraints, 'constraint')}>"
