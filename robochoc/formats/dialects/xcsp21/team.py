"""From an `Instance` to a team: names that are allowed here, owners of variables, costs as integers of one unit."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction

from robochoc.formats.definitions import PREDEFINED
from robochoc.formats.diagnostics import shortened
from robochoc.formats.dialects.dialect import Imported, ImportOptions, Names, Note, notes_on_names
from robochoc.formats.dialects.xcsp21.instance import (
    ForeignConstraint,
    Formula,
    Instance,
    Price,
    Sides,
    Table,
    refuse,
)
from robochoc.model.assembly import Extras, assemble
from robochoc.model.constraint import (
    INFINITE,
    Constraint,
    Domain,
    Function,
    GlobalPredicate,
    Predicate,
    Relation,
    Semantics,
    Term,
    Variable,
)
from robochoc.model.cost_units import PLAIN_COSTS, CostUnits
from robochoc.model.problem import ProblemKind


def as_team(instance: Instance, dialect: str, options: ImportOptions) -> Imported:
    """Return the team of `instance`, and what was mapped.

    Raises:
        InvalidInputError: if something has no counterpart here.
    """
    return _Import(instance, options).imported(dialect)


class _Import:
    """An instance on its way to a team."""

    def __init__(self, instance: Instance, options: ImportOptions) -> None:
        if not instance.variables:
            refuse(instance.file, 0, "has no variable", "there is nothing to decide")
        self._instance = instance
        self._options = options
        self._names = Names()
        self._notes = list(instance.notes)
        self._owned = self._with_owners()
        self._owner = {name: agent for agent, names in self._owned.items() for name in names}
        self._prices = list(_all_prices(instance))
        self._places = max(map(_places, self._prices))
        self._definitions = _Definitions(self._scaled)

    def imported(self, dialect: str) -> Imported:
        """Return the team."""
        instance = self._instance
        variables = {
            self._names.of(agent): [self._variable(name) for name in names]
            for agent, names in self._owned.items()
            if names
        }
        if idle := [agent for agent, names in self._owned.items() if not names]:
            told = f"agents without variables are left out: {shortened(' '.join(idle))}"
            self._notes.append(Note("left out", told))
        constraints: list[Constraint] = []
        parts: dict[str, list[Constraint]] = defaultdict(list)
        for one in instance.constraints:
            for knower, constraint in self._held(one):
                (parts[self._names.of(knower)] if knower else constraints).append(constraint)
        weighted = self._weighted()
        team = assemble(
            self._options.name or instance.name or instance.file.stem,
            variables,
            constraints,
            kind=ProblemKind.DISWCSP if weighted else ProblemKind.DISCSP,
            costs=self._units() if weighted else PLAIN_COSTS,
            extras=Extras(parts=parts),
        )
        changed = self._names.changed
        notes = (*notes_on_names([*changed.items()]), *self._notes)
        bound = None if instance.costs_from is None or instance.maximize else Fraction(instance.costs_from)
        return Imported(team, dialect, changed, notes, bound)

    # Owners

    def _with_owners(self) -> dict[str, list[str]]:
        """Return the variables of each agent, by their original names, and the agents in their order."""
        instance = self._instance
        owner = {one.name: one.owner for one in instance.variables.values()}
        agents = list(dict.fromkeys([*instance.agents, *filter(None, owner.values())]))
        if not agents:
            return self._owned_by_names()
        seen = _agents_that_see(instance, owner)
        owned: dict[str, list[str]] = {agent: [] for agent in agents}
        for name in instance.variables:
            agent = owner[name] or next((agent for agent in agents if agent in seen[name]), agents[0])
            owned[agent].append(name)
            if not owner[name]:
                self._notes.append(Note("shared variable", f"{name} is owned by {agent} from now on"))
        return owned

    def _owned_by_names(self) -> dict[str, list[str]]:
        """Return a robot for each variable, or for each group that `--owner` makes of their names."""
        owned: dict[str, list[str]] = defaultdict(list)
        for name in self._instance.variables:
            found = re.search(self._options.owner, name) if self._options.owner else None
            owned[(found[1] if found.re.groups else found[0]) if found else name].append(name)
        what = "by their names (--owner)" if self._options.owner else "one each"
        self._notes.append(Note("owners", f"variables have no agents in the file: robots own them, {what}"))
        return owned

    def _variable(self, name: str) -> Variable:
        variable = self._instance.variables[name]
        if not variable.ranges:
            refuse(self._instance.file, variable.line, f"the domain of '{shortened(name)}' is empty", "add a value")
        return Variable(self._names.of(name), Domain(word(variable.domain), variable.ranges))

    # Costs

    def _weighted(self) -> bool:
        return any(price not in {0, INFINITE} for price in self._prices) or any(
            _is_function(one) for one in self._instance.constraints
        )

    def _units(self) -> CostUnits:
        if self._places:
            told = f"costs are decimals: inside, 1 stands for {Decimal(1).scaleb(-self._places):f}"
            self._notes.append(Note("scale", told))
        if self._instance.maximize:
            self._notes.append(Note("maximize", "the sum is maximised"))
        return CostUnits(self._instance.maximize, self._places, int(self._scaled(self._instance.constant)))

    def _scaled(self, price: Price) -> float:
        return price if isinstance(price, float) else int(price.scaleb(self._places))

    # Constraints

    def _held(self, one: ForeignConstraint) -> Iterator[tuple[str, Constraint]]:
        """Yield a constraint, and the robot that alone knows of it; an empty text where all of its robots do."""
        if isinstance(one.content, Sides):
            yield from self._sides(one, one.content)
            return
        yield self._knower(one), self._constraint(one, one.content)

    def _sides(self, one: ForeignConstraint, sides: Sides) -> Iterator[tuple[str, Constraint]]:
        if len(one.scope) != 2:  # noqa: PLR2004 - a cost for each of two variables
            message = f"two costs a tuple, but {len(one.scope)} variables in '{shortened(one.name)}'"
            refuse(one.file, one.line, message, "asymmetric costs are for constraints of two variables")
        for variable, table in zip(one.scope, (sides.first, sides.second), strict=True):
            apart = self._owner[one.scope[0]] != self._owner[one.scope[1]]
            yield self._owner[variable] if apart else "", self._constraint(one, table)

    def _knower(self, one: ForeignConstraint) -> str:
        """Return the robot that alone knows of a constraint with another. Empty: there is none."""
        owners = {self._owner[name] for name in one.scope}
        if not one.knower:
            return ""
        if one.knower not in owners:
            what = f"constraint '{shortened(one.name)}' is known to {shortened(one.knower)} alone"
            refuse(one.file, one.line, f"{what}, who owns none of its variables", "let an agent of its scope know it")
        if len(owners) == 1:
            return ""
        if len(one.scope) > 2 or _is_function(one):  # noqa: PLR2004 - partially known constraints are binary
            told = f"{one.name} was known to {one.knower} alone; now all robots of its scope know it"
            self._notes.append(Note("known to more", told))
            return ""
        self._notes.append(Note("partially known", f"{one.name} is known to {one.knower} alone (PKC)"))
        return one.knower

    def _constraint(self, one: ForeignConstraint, content: Table | Formula) -> Constraint:
        scope = self._terms(one.scope)
        if isinstance(content, Table):
            return Constraint(word(one.name), self._definitions.relation(content, len(scope)), scope, scope)
        cost = INFINITE if content.cost is None else self._scaled(content.cost)
        definition = self._definitions.formula(content.definition)
        return Constraint(word(one.name), definition, scope, self._terms(content.terms), cost=cost)

    def _terms(self, terms: Iterable[Term]) -> tuple[Term, ...]:
        return tuple(term if isinstance(term, int) else self._names.of(term) for term in terms)


class _Definitions:
    """Relations, predicates and functions, each under a name of its own."""

    def __init__(self, scaled: Callable[[Price], float]) -> None:
        self._scaled = scaled
        self._taken: dict[str, object] = dict(PREDEFINED)
        self._formulas: dict[Predicate | Function, Predicate | Function] = {}
        self._relations: dict[int, tuple[Table, Relation]] = {}

    def formula(self, definition: Predicate | Function) -> Predicate | Function:
        """Return `definition` under a name that no other has."""
        if isinstance(definition, GlobalPredicate):
            return definition
        if definition not in self._formulas:
            self._formulas[definition] = replace(definition, name=self._free(definition.name, definition))
        return self._formulas[definition]

    def relation(self, table: Table, arity: int) -> Relation:
        """Return the relation that `table` is: a soft one only where a cost is neither 0 nor infinite."""
        if id(table) not in self._relations:
            self._relations[id(table)] = table, self._relation(table, arity)
        return self._relations[id(table)][1]

    def _relation(self, table: Table, arity: int) -> Relation:
        name = self._free(table.name, table)
        if {table.default, *table.costs.values()} <= {0, INFINITE}:
            allowed = table.default == INFINITE
            listed = tuple(values for values, price in table.costs.items() if (price == 0) is allowed)
            return Relation(name, arity, Semantics.SUPPORTS if allowed else Semantics.CONFLICTS, listed)
        costs = tuple(self._scaled(price) for price in table.costs.values())
        return Relation(name, arity, Semantics.SOFT, tuple(table.costs), costs, self._scaled(table.default))

    def _free(self, name: str, thing: object) -> str:
        base, number = word(name), 1
        free = base
        while self._taken.setdefault(free, thing) != thing:
            number += 1
            free = f"{base}_{number}"
        return free


def _agents_that_see(instance: Instance, owner: Mapping[str, str]) -> Mapping[str, set[str]]:
    """Return, for each variable that nobody owns, the agents that have constraints on it."""
    seen: dict[str, set[str]] = defaultdict(set)
    for one in instance.constraints:
        for name in one.scope:
            if not owner[name]:
                seen[name] |= {owner[other] for other in one.scope} | {one.knower}
    return seen


def _all_prices(instance: Instance) -> Iterator[Price]:
    """Yield every cost, those of a table once."""
    yield instance.constant
    met: set[int] = set()
    for one in instance.constraints:
        match one.content:
            case Formula(cost=cost):
                if cost is not None:
                    yield cost
            case Table() as table:
                yield from _prices(table, met)
            case Sides(first=first, second=second):
                yield from _prices(first, met)
                yield from _prices(second, met)


def _prices(table: Table, met: set[int]) -> Iterator[Price]:
    if id(table) not in met:
        met.add(id(table))
        yield table.default
        yield from table.costs.values()


def _is_function(one: ForeignConstraint) -> bool:
    return isinstance(one.content, Formula) and isinstance(one.content.definition, Function)


def _places(price: Price) -> int:
    return 0 if isinstance(price, float) else max(0, -int(price.as_tuple().exponent))


def word(name: str) -> str:
    """Return `name` without blanks, as names of domains, definitions and constraints are."""
    return re.sub(r"\s+", "_", name) or "_"
