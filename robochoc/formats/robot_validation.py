"""Validate a robot built in Python by the same rules as a file, with names instead of line numbers."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager

from robochoc.formats.costs import check_units
from robochoc.formats.definitions import (
    PREDEFINED,
    check_body,
    check_domain,
    check_relation,
    check_semantics,
    check_topic,
    refuse_function,
    refuse_predefined,
)
from robochoc.formats.diagnostics import MAX_PER_FILE, Diagnostic, MistakeError, shortened
from robochoc.formats.field_types import FIELD_TYPES_HINT, FieldTypeError, check_field_types
from robochoc.formats.global_constraints import check_global
from robochoc.formats.locations import Location, ObjectLocations
from robochoc.formats.names import check_name, check_robot_name, check_unique, check_weight, check_word
from robochoc.formats.objectives import check_objective, check_objectives
from robochoc.formats.random_variables import check_random
from robochoc.formats.real_numbers import check_function_places, check_real_domain
from robochoc.formats.robot_rules import (
    NEIGHBOURS_ONCE,
    check_constraint,
    check_private,
    check_shared,
    check_shown_variables,
    check_terms,
    refuse_no_model,
    refuse_no_variables,
    refuse_private_part,
    repeated_neighbours,
)
from robochoc.formats.symbols import (
    check_argument_types,
    check_one_table,
    check_symbolic_definition,
    check_symbolic_domain,
    kinds_by_variable,
)
from robochoc.model.problem import (
    Constraint,
    ConstraintModel,
    Definition,
    Domain,
    Function,
    GlobalPredicate,
    Relation,
    Robot,
)

Defined = Domain | Definition


class RobotValidator:
    """Validates robots one after the other. Domains and definitions common to several robots are checked once."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[Defined, bool]] = {}
        """By `id`: the object, which is stored so that its `id` is not reused, and whether it is valid."""
        self._invalid: list[Defined] = []
        """The invalid definitions of the current robot. In a file, equal definitions are written once."""
        self._found: list[Diagnostic] = []
        self._table: tuple[str, ...] = ()
        """The symbols of the current robot."""

    def mistakes(self, robot: Robot) -> list[Diagnostic]:
        """Return the errors in `robot` that can be found without its neighbours."""
        self._found, self._invalid = [], []
        if self._has_valid_types(robot):
            for _ in self._check_parts(robot, ObjectLocations(robot.name)):
                if len(self._found) > MAX_PER_FILE:
                    del self._found[MAX_PER_FILE:]
                    self._add(ObjectLocations(robot.name).robot(), "more mistakes", "fix those above first")
                    break
        return self._found

    def mistakes_of_constraint(self, constraint: Constraint, robot: Robot) -> list[Diagnostic]:
        """Return the errors in a shared constraint that `robot` will get."""
        self._found, self._invalid = [], []
        own = dict.fromkeys(variable.name for variable in robot.variables)
        self._table = robot.symbol_table
        self._shared(constraint, own, robot, ObjectLocations(robot.name))
        return self._found

    def _has_valid_types(self, robot: Robot) -> bool:
        try:
            check_field_types(robot, Robot)
        except FieldTypeError as error:
            name = robot.name if isinstance(getattr(robot, "name", None), str) else "?"
            self._add(ObjectLocations(name).robot(), error.explanation, FIELD_TYPES_HINT)
            return False
        return True

    def _check_parts(self, robot: Robot, places: ObjectLocations) -> Iterator[None]:
        """Check the parts one by one. Yield after each part, so that the caller can stop."""
        own = dict.fromkeys(variable.name for variable in robot.variables)
        with self._at(places.robot):
            check_robot_name(robot.name)
        with self._at(places.robot):
            check_weight(robot.weight)
        with self._at(places.robot):
            check_units(robot.costs, robot.kind)
            check_one_table(robot)
            check_objectives(robot.objectives, robot.kind, robot.costs)
        self._table = robot.symbol_table
        self._random_variables(robot, places)
        yield from self._variables(robot, places)
        if not own:
            return  # further errors may be consequences of this one
        yield from self._topics(robot, own, places)
        for constraint in robot.private:
            self._private(constraint, own, robot, places)
            yield
        for parent in robot.parents:
            with self._at(places.neighbour, parent):
                check_name(parent.name)
            for constraint in parent.constraints:
                self._shared(constraint, own, robot, places)
                yield
        yield from self._children(robot, own, places)
        for neighbour, message in repeated_neighbours(robot.name, robot.parents, robot.children):
            self._add(places.neighbour(neighbour), message, NEIGHBOURS_ONCE)
            yield

    def _random_variables(self, robot: Robot, places: ObjectLocations) -> None:
        declared = robot.declared
        if declared is None and robot.random:
            message = "the robot has random variables, which runs do not know"
            self._add(places.robot(), message, "use robochoc.model.uncertainty.expected_robot(robot)")
        elif declared is not None:
            seen: list[str] = []
            for one in robot.random:
                with self._at(places.part, "random variable", one.name):
                    check_random(one, [variable.name for variable in declared.variables], seen)
                seen.append(one.name)

    def _variables(self, robot: Robot, places: ObjectLocations) -> Iterator[None]:
        with self._at(places.robot):
            refuse_no_variables(robot.variables)
        seen: set[str] = set()
        for variable in robot.variables:
            with self._at(places.variable, variable.name):
                check_name(variable.name)
                check_unique("variable", variable.name, seen)
            seen.add(variable.name)
            self._check_defined(variable.domain, places)
            yield
        for name in robot.shown:
            if name not in seen:
                message = f"`shown` contains '{shortened(name)}', which is not a variable of this robot"
                self._add(places.robot(), message, "leave it out: only changes of a team set `shown`")
            yield

    def _topics(self, robot: Robot, own: Collection[str], places: ObjectLocations) -> Iterator[None]:
        symbolic = [one.name for one in robot.variables if one.domain.symbols]
        seen: set[str] = set()
        for topic in robot.topics:
            with self._at(places.part, "topic", topic.name):
                check_topic(topic, own, symbolic, robot.symbol_table)
                check_unique("topic", topic.name, seen)
            seen.add(topic.name)
            yield

    def _children(self, robot: Robot, own: Collection[str], places: ObjectLocations) -> Iterator[None]:
        for child in robot.children:
            with self._at(places.neighbour, child):
                check_name(child.name)
                check_shown_variables(child.variables, own)
            for constraint in child.constraints:
                if constraint.model == ConstraintModel.TKC:
                    message = f"a totally known constraint (TKC) with the child '{shortened(child.name)}'"
                    hint = "move it to the child: a parent lists only its parts of PKCs"
                    self._add(places.constraint(constraint), message, hint)
                else:
                    self._shared(constraint, own, robot, places)
                yield
            for copy in child.copies:
                if copy.model == ConstraintModel.PKC:
                    message = f"a copy of a partially known constraint (PKC) of the child '{shortened(child.name)}'"
                    self._add(places.constraint(copy), message, "leave it out: only the child knows its part")
                else:
                    self._shared(copy, own, robot, places)
                yield

    def _private(self, constraint: Constraint, own: Collection[str], robot: Robot, places: ObjectLocations) -> None:
        with self._at(places.constraint, constraint):
            refuse_private_part(constraint.model)
            self._check_constraint(constraint, robot, places)
            if constraint.variables:
                check_private(constraint, own)

    def _shared(self, constraint: Constraint, own: Collection[str], robot: Robot, places: ObjectLocations) -> None:
        with self._at(places.constraint, constraint):
            refuse_no_model(constraint.model)
            self._check_constraint(constraint, robot, places)
            if constraint.variables:
                check_shared(constraint, own)

    def _check_constraint(self, constraint: Constraint, robot: Robot, places: ObjectLocations) -> None:
        """Check a constraint; only the scope is checked further if its definition is invalid. Raises `MistakeError`."""
        definition = constraint.definition
        check_word(constraint.name)
        check_terms(constraint.scope)
        check_terms(constraint.parameters)
        is_valid = self._check_defined(definition, places)
        if isinstance(definition, Relation):
            check_semantics(definition.semantics, robot.kind)
        if isinstance(definition, Function):
            refuse_function(robot.kind)
            check_function_places(definition, robot.costs)
        if is_valid:
            check_constraint(constraint, robot.kind, robot.costs)
            check_objective(constraint, robot.objectives)
            check_argument_types(constraint, kinds_by_variable([robot]))

    def _check_defined(self, thing: Defined, places: ObjectLocations) -> bool:
        """Return whether a domain or a definition is valid. Its error is reported for the first robot that uses it."""
        known = self._known.get(id(thing))
        if known is None:
            known = self._known[id(thing)] = (thing, self._is_valid(thing, places))
        return known[1]

    def _is_valid(self, thing: Defined, places: ObjectLocations) -> bool:
        try:
            _check_defined(thing, self._table)
        except MistakeError as mistake:
            if thing not in self._invalid:
                place = places.part(type(thing).__name__.lower(), thing.name)
                self._add(place, mistake.message, mistake.hint)
            self._invalid.append(thing)
            return False
        return True

    @contextmanager
    def _at(self, place: Callable[..., Location], *part: object) -> Iterator[None]:
        """Add a `MistakeError` raised inside. The `place` of the `part` is computed only in this case."""
        try:
            yield
        except MistakeError as mistake:
            self._add(place(*part), mistake.message, mistake.hint)

    def _add(self, place: Location, message: str, hint: str) -> None:
        self._found.append(place.mistake(message, hint))


def _check_defined(thing: Defined, table: tuple[str, ...]) -> None:
    check_word(thing.name)
    if isinstance(thing, Domain):
        check_domain(thing)
        if thing.symbols:
            check_symbolic_domain(thing)
        if thing.real:
            check_real_domain(thing, thing.real)
        return
    if PREDEFINED.get(thing.name) == thing:
        return
    if isinstance(thing, GlobalPredicate):
        check_global(thing)
        return
    refuse_predefined(thing.name)
    if isinstance(thing, Relation):
        check_relation(thing)
    check_symbolic_definition(thing, table)
    if not isinstance(thing, Relation):
        check_body(thing, table)


def repeated_robots(robots: Iterable[Robot]) -> Iterator[Diagnostic]:
    """Yield robots with the name of another robot."""
    seen: set[str] = set()
    for robot in robots:
        if robot.name in seen:
            message = f"a second robot '{shortened(robot.name)}'"
            yield ObjectLocations(robot.name).robot().mistake(message, "names of robots are unique: rename one of them")
        seen.add(robot.name)
