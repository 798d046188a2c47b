"""Convert an `Instance` to a team, with valid names, an owner for each variable, and integer costs in one unit."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction

from robochoc.formats.definitions import PREDEFINED
from robochoc.formats.diagnostics import shortened
from robochoc.formats.dialects.dialect import ConversionNote, ImportOptions, ImportResult, NameMap, notes_on_names
from robochoc.formats.dialects.xcsp21.instance import (
    AsymmetricTable,
    ForeignConstraint,
    ForeignTable,
    Formula,
    Instance,
    Price,
    refuse,
)
from robochoc.formats.dialects.xcsp21.probabilities import places_left, random_variables
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
from robochoc.model.problem import ProblemKind, RandomVariable
from robochoc.system.plain_text import counted


def to_team(instance: Instance, dialect: str, options: ImportOptions) -> ImportResult:
    """Return the team of `instance`, and notes on the differences.

    Raises:
        InvalidInputError: if a part of the instance has no counterpart in a team.
    """
    return _TeamBuilder(instance, options).imported(dialect)


class _TeamBuilder:
    def __init__(self, instance: Instance, options: ImportOptions) -> None:
        if not instance.variables:
            refuse(instance.file, 0, "has no variables", "declare at least one in <variables>")
        self._instance = instance
        self._options = options
        self._names = NameMap()
        self._notes = list(instance.notes)
        self._owned = self._with_owners()
        self._owner = {name: agent for agent, names in self._owned.items() for name in names}
        self._prices = list(_all_prices(instance))
        self._places = max(map(_places, self._prices))
        self._definitions = _Definitions(self._in_units)

    def imported(self, dialect: str) -> ImportResult:
        """Return the team."""
        instance = self._instance
        variables = {
            self._names.allowed(agent): [self._variable(name) for name in names]
            for agent, names in self._owned.items()
            if names
        }
        if idle := [agent for agent, names in self._owned.items() if not names]:
            text = f"agents without variables are left out: {shortened(' '.join(idle))}"
            self._notes.append(ConversionNote("left out", text))
        constraints: list[Constraint] = []
        parts: dict[str, list[Constraint]] = defaultdict(list)
        for one in instance.constraints:
            for private_agent, constraint in self._constraints(one):
                (parts[self._names.allowed(private_agent)] if private_agent else constraints).append(constraint)
        is_weighted = self._is_weighted()
        team = assemble(
            self._options.name or instance.name or instance.file.stem,
            variables,
            constraints,
            kind=ProblemKind.DISWCSP if is_weighted else ProblemKind.DISCSP,
            costs=self._units() if is_weighted else PLAIN_COSTS,
            extras=Extras(parts=parts, random=self._random_variables()),
        )
        changed = self._names.originals
        notes = (*notes_on_names([*changed.items()]), *self._notes)
        bound = None if instance.maximal_cost is None or instance.maximize else Fraction(instance.maximal_cost)
        return ImportResult(team, dialect, changed, notes, bound)

    # Owners

    def _with_owners(self) -> dict[str, list[str]]:
        """Return the variables of each agent by their original names, with the agents in the order of the file."""
        instance = self._instance
        owner = {one.name: one.owner for one in instance.variables.values()}
        agents = list(dict.fromkeys([*instance.agents, *filter(None, owner.values())]))
        if not agents:
            return self._owned_by_names()
        seen = _constrained_agents(instance, owner)
        owned: dict[str, list[str]] = {agent: [] for agent in agents}
        for name in instance.variables:
            agent = owner[name] or next((agent for agent in agents if agent in seen[name]), agents[0])
            owned[agent].append(name)
            if not owner[name]:
                self._notes.append(ConversionNote("shared variable", f"{name} has no owner in the file: now {agent}"))
        return owned

    def _owned_by_names(self) -> dict[str, list[str]]:
        """Return one robot for each variable, or for each group of variables by `--owner`."""
        owned: dict[str, list[str]] = defaultdict(list)
        for name in self._instance.variables:
            found = re.search(self._options.owner, name) if self._options.owner else None
            owned[(found[1] if found.re.groups else found[0]) if found else name].append(name)
        what = "robots own them by their names (--owner)" if self._options.owner else "each gets its own robot"
        self._notes.append(ConversionNote("owners", f"variables have no agents in the file: {what}"))
        return owned

    def _variable(self, name: str) -> Variable:
        variable = self._instance.variables[name]
        if not variable.ranges:
            refuse(self._instance.file, variable.line, f"the domain of '{shortened(name)}' is empty", "add a value")
        return Variable(self._names.allowed(name), Domain(without_blanks(variable.domain), variable.ranges))

    def _random_variables(self) -> list[RandomVariable]:
        instance = self._instance
        together = max((len(instance.random.keys() & set(one.scope)) for one in instance.constraints), default=0)
        most = places_left(self._places, together)
        if instance.random and not most:
            message = f"a constraint has {together} random variables, and costs {self._places} decimal places"
            refuse(instance.file, 0, message, "use fewer of them: expected costs have at most nine decimal places")
        for name, law in instance.laws.items():
            if len(law) > 10**most:
                message = f"'{shortened(name)}' has {len(law):,} outcomes"
                message += f", but probabilities with {counted(most, 'decimal place')}"
                hint = "use fewer outcomes, or fewer random variables in a constraint"
                refuse(instance.file, instance.random[name].line, message, hint)
        laws = {self._names.allowed(name): law for name, law in instance.laws.items()}
        found, is_rounded = random_variables(laws, most)
        if is_rounded:
            self._notes.append(ConversionNote("rounded", f"probabilities are rounded to {most} decimal places"))
        return found

    # Costs

    def _is_weighted(self) -> bool:
        return any(price not in {0, INFINITE} for price in self._prices) or any(
            _is_function(one) for one in self._instance.constraints
        )

    def _units(self) -> CostUnits:
        if self._places:
            text = f"costs are decimals, stored as integers in units of {Decimal(1).scaleb(-self._places):f}"
            self._notes.append(ConversionNote("scale", text))
        if self._instance.maximize:
            self._notes.append(ConversionNote("maximize", "the sum is maximised"))
        return CostUnits(self._instance.maximize, self._places, int(self._in_units(self._instance.constant)))

    def _in_units(self, price: Price) -> float:
        return price if isinstance(price, float) else int(price.scaleb(self._places))

    # Constraints

    def _constraints(self, one: ForeignConstraint) -> Iterator[tuple[str, Constraint]]:
        """Yield the team's constraints for a constraint of the file, each with the only robot that knows it, or ""."""
        if isinstance(one.content, AsymmetricTable):
            yield from self._asymmetric_parts(one, one.content)
            return
        yield self._private_agent(one), self._constraint(one, one.content)

    def _asymmetric_parts(self, one: ForeignConstraint, sides: AsymmetricTable) -> Iterator[tuple[str, Constraint]]:
        if len(one.scope) != 2 or any(name in self._instance.random for name in one.scope):  # noqa: PLR2004 - a cost for each of two variables
            message = f"'{shortened(one.name)}' has two costs for each tuple, but {len(one.scope)} variables"
            refuse(one.file, one.line, message, "use asymmetric costs only for constraints on two agents' variables")
        for variable, table in zip(one.scope, (sides.first, sides.second), strict=True):
            apart = self._owner[one.scope[0]] != self._owner[one.scope[1]]
            yield self._owner[variable] if apart else "", self._constraint(one, table)

    def _private_agent(self, one: ForeignConstraint) -> str:
        """Return the only robot that knows a constraint with another robot, or an empty text."""
        owners = {self._owner[name] for name in one.scope if name in self._owner}
        if not one.private_agent:
            return ""
        if one.private_agent not in owners:
            what = f"the constraint '{shortened(one.name)}' is known only to {shortened(one.private_agent)}, which owns"
            refuse(one.file, one.line, f"{what} none of its variables", "name an agent that owns one of them")
        if len(owners) == 1:
            return ""
        is_random = any(name in self._instance.random for name in one.scope)
        if len(one.scope) > 2 or is_random or _is_function(one):  # noqa: PLR2004 - partially known constraints are binary
            text = f"{one.name} is known only to {one.private_agent} in the file; now all robots of its scope know it"
            self._notes.append(ConversionNote("known to more", text))
            return ""
        self._notes.append(ConversionNote("partially known", f"{one.name} is known only to {one.private_agent} (PKC)"))
        return one.private_agent

    def _constraint(self, one: ForeignConstraint, content: ForeignTable | Formula) -> Constraint:
        scope = self._terms(one.scope)
        if isinstance(content, ForeignTable):
            return Constraint(without_blanks(one.name), self._definitions.relation(content, len(scope)), scope, scope)
        cost = INFINITE if content.cost is None else self._in_units(content.cost)
        definition = self._definitions.formula(content.definition)
        return Constraint(without_blanks(one.name), definition, scope, self._terms(content.terms), cost=cost)

    def _terms(self, terms: Iterable[Term]) -> tuple[Term, ...]:
        return tuple(term if isinstance(term, int) else self._names.allowed(term) for term in terms)


class _Definitions:
    """Relations, predicates and functions with unique names."""

    def __init__(self, in_units: Callable[[Price], float]) -> None:
        self._in_units = in_units
        self._taken: dict[str, object] = dict(PREDEFINED)
        self._formulas: dict[Predicate | Function, Predicate | Function] = {}
        self._relations: dict[int, tuple[ForeignTable, Relation]] = {}

    def formula(self, definition: Predicate | Function) -> Predicate | Function:
        """Return `definition` with a unique name."""
        if isinstance(definition, GlobalPredicate):
            return definition
        if definition not in self._formulas:
            self._formulas[definition] = replace(definition, name=self._free_name(definition.name, definition))
        return self._formulas[definition]

    def relation(self, table: ForeignTable, arity: int) -> Relation:
        """Return `table` as a relation, which is soft only if a cost is neither 0 nor infinite."""
        if id(table) not in self._relations:
            self._relations[id(table)] = table, self._relation(table, arity)
        return self._relations[id(table)][1]

    def _relation(self, table: ForeignTable, arity: int) -> Relation:
        name = self._free_name(table.name, table)
        if {table.default, *table.costs.values()} <= {0, INFINITE}:
            allowed = table.default == INFINITE
            listed = tuple(values for values, price in table.costs.items() if (price == 0) is allowed)
            return Relation(name, arity, Semantics.SUPPORTS if allowed else Semantics.CONFLICTS, listed)
        costs = tuple(self._in_units(price) for price in table.costs.values())
        return Relation(name, arity, Semantics.SOFT, tuple(table.costs), costs, self._in_units(table.default))

    def _free_name(self, name: str, thing: object) -> str:
        base, number = without_blanks(name), 1
        free = base
        while self._taken.setdefault(free, thing) != thing:
            number += 1
            free = f"{base}_{number}"
        return free


def _constrained_agents(instance: Instance, owner: Mapping[str, str]) -> Mapping[str, set[str]]:
    """Return, for each variable without an owner, the agents with constraints on it."""
    seen: dict[str, set[str]] = defaultdict(set)
    for one in instance.constraints:
        for name in one.scope:
            if owner.get(name) == "":
                seen[name] |= {owner.get(other, "") for other in one.scope} | {one.private_agent}
    return seen


def _all_prices(instance: Instance) -> Iterator[Price]:
    """Yield every cost; the costs of a shared table are yielded once."""
    yield instance.constant
    seen_tables: set[int] = set()
    for one in instance.constraints:
        match one.content:
            case Formula(cost=cost):
                if cost is not None:
                    yield cost
            case ForeignTable() as table:
                yield from _prices(table, seen_tables)
            case AsymmetricTable(first=first, second=second):
                yield from _prices(first, seen_tables)
                yield from _prices(second, seen_tables)


def _prices(table: ForeignTable, seen_tables: set[int]) -> Iterator[Price]:
    if id(table) not in seen_tables:
        seen_tables.add(id(table))
        yield table.default
        yield from table.costs.values()


def _is_function(one: ForeignConstraint) -> bool:
    return isinstance(one.content, Formula) and isinstance(one.content.definition, Function)


def _places(price: Price) -> int:
    return 0 if isinstance(price, float) else max(0, -int(price.as_tuple().exponent))


def without_blanks(name: str) -> str:
    """Return `name` with blanks replaced, as a name of a domain, definition or constraint."""
    return re.sub(r"\s+", "_", name) or "_"
