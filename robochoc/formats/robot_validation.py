"""A robot that was built in Python, object by object: the same rules as for a file, with names instead of lines."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager

from robochoc.formats.costs import check_units
from robochoc.formats.definitions import (
    PREDEFINED,
    check_domain,
    check_relation,
    check_semantics,
    check_stated,
    check_topic,
    refuse_function,
    refuse_predefined,
)
from robochoc.formats.diagnostics import MAX_PER_FILE, Diagnostic, MistakeError, shortened
from robochoc.formats.field_types import AS_BUILT, FieldTypeError, check_field_types
from robochoc.formats.global_constraints import check_global
from robochoc.formats.locations import Location, ObjectLocations
from robochoc.formats.names import check_name, check_robot_name, check_unique, check_weight, check_word
from robochoc.formats.robot_rules import (
    NEIGHBOURS_ONCE,
    check_constraint,
    check_private,
    check_shared,
    check_shown_variables,
    check_terms,
    refuse_no_model,
    refuse_nothing_to_decide,
    refuse_private_part,
    repeated_neighbours,
)
from robochoc.formats.symbols import (
    check_kinds,
    check_one_table,
    check_symbolic_definition,
    check_symbolic_domain,
    kinds_of,
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
    """Checks robots one after the other. What they share, domains and definitions, is looked at once."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[Defined, bool]] = {}
        """By `id`: the object, which is kept so that the number stays its own, and whether it is right."""
        self._wrong: list[Defined] = []
        """The definitions of the robot in hand that are wrong. In a file, equal ones are written once."""
        self._found: list[Diagnostic] = []
        self._table: tuple[str, ...] = ()
        """The symbols of the robot in hand."""

    def mistakes(self, robot: Robot) -> list[Diagnostic]:
        """Return what is wrong with `robot` by itself: nothing of its neighbours is looked at."""
        self._found, self._wrong = [], []
        if self._is_made_right(robot):
            for _ in self._steps(robot, ObjectLocations(robot.name)):
                if len(self._found) > MAX_PER_FILE:
                    del self._found[MAX_PER_FILE:]
                    self._note(ObjectLocations(robot.name).robot(), "and more mistakes", "mend those above first")
                    break
        return self._found

    def mistakes_of_constraint(self, constraint: Constraint, robot: Robot) -> list[Diagnostic]:
        """Return what is wrong with a constraint that `robot` is to share from now on."""
        self._found, self._wrong = [], []
        own = dict.fromkeys(variable.name for variable in robot.variables)
        self._table = robot.symbol_table
        self._shared(constraint, own, robot, ObjectLocations(robot.name))
        return self._found

    def _is_made_right(self, robot: Robot) -> bool:
        try:
            check_field_types(robot, Robot)
        except FieldTypeError as error:
            name = robot.name if isinstance(getattr(robot, "name", None), str) else "?"
            self._note(ObjectLocations(name).robot(), error.explanation, AS_BUILT)
            return False
        return True

    def _steps(self, robot: Robot, places: ObjectLocations) -> Iterator[None]:
        """Look at one object after the other."""
        own = dict.fromkeys(variable.name for variable in robot.variables)
        with self._at(places.robot):
            check_robot_name(robot.name)
        with self._at(places.robot):
            check_weight(robot.weight)
        with self._at(places.robot):
            check_units(robot.costs, robot.kind)
            check_one_table(robot)
        self._table = robot.symbol_table
        yield from self._variables(robot, places)
        if not own:
            return  # whatever else is wrong may follow from it
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
            self._note(places.neighbour(neighbour), message, NEIGHBOURS_ONCE)
            yield

    def _variables(self, robot: Robot, places: ObjectLocations) -> Iterator[None]:
        with self._at(places.robot):
            refuse_nothing_to_decide(robot.variables)
        seen: set[str] = set()
        for variable in robot.variables:
            with self._at(places.variable, variable.name):
                check_name(variable.name)
                check_unique("variable", variable.name, seen)
            seen.add(variable.name)
            self._defined(variable.domain, places)
            yield
        for name in robot.shown:
            if name not in seen:
                message = f"the robot is to show '{shortened(name)}', which is not its own"
                self._note(places.robot(), message, "only a change of the team needs `shown`: leave it out")
            yield

    def _topics(self, robot: Robot, own: Collection[str], places: ObjectLocations) -> Iterator[None]:
        symbolic = [one.name for one in robot.variables if one.domain.symbols]
        seen: set[str] = set()
        for topic in robot.topics:
            with self._at(places.part, "topic", topic.name):
                check_topic(topic, own, symbolic)
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
                    hint = "the child holds it; with the parent stands its part of a PKC only"
                    self._note(places.constraint(constraint), message, hint)
                else:
                    self._shared(constraint, own, robot, places)
                yield
            for copy in child.copies:
                if copy.model == ConstraintModel.PKC:
                    message = f"a copy of a partially known constraint (PKC) of the child '{shortened(child.name)}'"
                    self._note(places.constraint(copy), message, "nobody knows another's part: leave the copy out")
                else:
                    self._shared(copy, own, robot, places)
                yield

    def _private(self, constraint: Constraint, own: Collection[str], robot: Robot, places: ObjectLocations) -> None:
        with self._at(places.constraint, constraint):
            refuse_private_part(constraint.model)
            if self._applied(constraint, robot, places):
                check_private(constraint, own)

    def _shared(self, constraint: Constraint, own: Collection[str], robot: Robot, places: ObjectLocations) -> None:
        with self._at(places.constraint, constraint):
            refuse_no_model(constraint.model)
            if self._applied(constraint, robot, places):
                check_shared(constraint, own)

    def _applied(self, constraint: Constraint, robot: Robot, places: ObjectLocations) -> bool:
        """Check a constraint. Return False if its definition has the mistake. Raises `MistakeError`."""
        definition = constraint.definition
        check_word(constraint.name)
        check_terms(constraint.scope)
        check_terms(constraint.parameters)
        right = self._defined(definition, places)
        if isinstance(definition, Relation):
            check_semantics(definition.semantics, robot.kind)
        if isinstance(definition, Function):
            refuse_function(robot.kind)
        if right:
            check_constraint(constraint, robot.kind, robot.costs)
            check_kinds(constraint, kinds_of([robot]))
        return right

    def _defined(self, thing: Defined, places: ObjectLocations) -> bool:
        """Return whether a domain or a definition is right. Its mistake is noted for the first robot that has it."""
        known = self._known.get(id(thing))
        if known is None:
            known = self._known[id(thing)] = (thing, self._is_right(thing, places))
        return known[1]

    def _is_right(self, thing: Defined, places: ObjectLocations) -> bool:
        try:
            _check_defined(thing, self._table)
        except MistakeError as mistake:
            if thing not in self._wrong:
                place = places.part(type(thing).__name__.lower(), thing.name)
                self._note(place, mistake.message, mistake.hint)
            self._wrong.append(thing)
            return False
        return True

    @contextmanager
    def _at(self, place: Callable[..., Location], *part: object) -> Iterator[None]:
        """Note a `MistakeError` raised inside. Only then the `place` of the `part` is computed."""
        try:
            yield
        except MistakeError as mistake:
            self._note(place(*part), mistake.message, mistake.hint)

    def _note(self, place: Location, message: str, hint: str) -> None:
        self._found.append(place.mistake(message, hint))


def _check_defined(thing: Defined, table: tuple[str, ...]) -> None:
    check_word(thing.name)
    if isinstance(thing, Domain):
        check_domain(thing)
        if thing.symbols:
            check_symbolic_domain(thing)
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
        check_stated(thing, table)


def repeated_robots(robots: Iterable[Robot]) -> Iterator[Diagnostic]:
    """Yield robots of one name."""
    seen: set[str] = set()
    for robot in robots:
        if robot.name in seen:
            message = f"a second robot '{shortened(robot.name)}'"
            yield ObjectLocations(robot.name).robot().mistake(message, "names of robots are unique: rename one of them")
        seen.add(robot.name)
