"""A constraint shared with other robots, compiled for fast checks; results are cached by the others' values."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from copy import copy
from typing import TYPE_CHECKING, NamedTuple

from robochoc.model.absence import may_count_when_absent, restated
from robochoc.model.problem import INFINITE, Constraint, Domain, Value
from robochoc.solver.agent_problem import TeamKnowledge
from robochoc.solver.encoding import MAX_TUPLES, Cost, allows_function, cost_function, is_soft, max_cost
from robochoc.solver.errors import TooLargeError
from robochoc.solver.evaluations import Evaluations, SharedEvaluations

if TYPE_CHECKING:
    from numpy import float64
    from numpy.typing import NDArray

    from robochoc.solver.constraint_arrays import RowCosts

Conflict = Mapping[str, Value]
"""Assignments of other robots that exclude a value of this robot: the left side of a nogood."""

UNKNOWN = -1
"""The mask if there is none: a value in the scope is unknown, or a withdrawn robot drops the constraint."""

OtherValues = tuple[int | None, ...]
"""The values of other robots' variables in a constraint, in the constraint's order. None: withdrawn."""


class Gap(NamedTuple):
    """The others' values that violate a constraint with a value of this robot, and those that satisfy it."""

    broken: Sequence[Conflict]
    allowed: Sequence[Conflict]


class OwnValues:
    """This robot's compiled domain: `values` of the variables `names`, and the codes that constraints distinguish.

    A constraint contains some of the variables; values that agree on these variables have the same code. Many
    constraints share their codes.
    """

    def __init__(self, names: Sequence[str], values: Sequence[Value]) -> None:
        self._names = names
        self._values = values
        self._axes: dict[tuple[int, ...], Axis] = {}
        self._code_values: dict[tuple[int, ...], list[int]] = {}
        self._numbers: dict[tuple[int, ...], int] = {}

    def seen(self, scope: Container[str]) -> tuple[tuple[int, ...], list[str]]:
        """Return the indices and names of this robot's variables in `scope`."""
        places = tuple([place for place, name in enumerate(self._names) if name in scope])
        return places, [self._names[place] for place in places]

    def axis(self, places: tuple[int, ...]) -> Axis:
        """Return the axis of the variables at `places`. Many constraints share it."""
        if places not in self._axes:
            self._axes[places] = axis(self._values, places)
        return self._axes[places]

    def code_values(self, places: tuple[int, ...]) -> list[int]:
        """Return, for each code for `places`, its values: bit i for the i-th value."""
        if places not in self._code_values:
            axis = self.axis(places)
            found = [0] * len(axis.parts)
            for index, code in enumerate(axis.codes):
                found[code] |= 1 << index
            self._code_values[places] = found
        return self._code_values[places]

    @property
    def width(self) -> int:
        """The number of interface variables."""
        return len(self._names)

    def number(self, places: tuple[int, ...], shared: SharedEvaluations) -> int:
        """Return a number in `shared` that determines the `axis` for `places`."""
        if places not in self._numbers:
            _, codes, parts = self.axis(places)
            self._numbers[places] = shared.number((tuple(codes), tuple(parts)))
        return self._numbers[places]

    def shown(self, index: int, places: Container[int]) -> Value:
        """Return the value at `index`, with None outside `places`."""
        return tuple([part if place in places else None for place, part in enumerate(self._values[index])])


class Axis(NamedTuple):
    """A robot's values as a constraint distinguishes them.

    Attributes:
        places: The indices of the robot's variables in the constraint, among its interface variables.
        codes: The code of each value: its index in `parts`. If all values are distinguished, these are 0, 1, 2, ...
        parts: The distinct values of these variables, in the order of their first occurrence.
    """

    places: tuple[int, ...]
    codes: Sequence[int]
    parts: Sequence[Value]


def axis(values: Iterable[Value], places: tuple[int, ...]) -> Axis:
    """Return the axis for the variables at `places` of a robot with these `values`."""
    found: dict[Value, int] = {}
    codes = [found.setdefault(tuple([value[place] for place in places]), len(found)) for value in values]
    return Axis(places, codes, list(found))


def refuse_large(key: str, entries: int) -> None:
    """Raise `TooLargeError` if the table of the constraint called `key` has more than `MAX_TUPLES` entries."""
    if entries > MAX_TUPLES:
        raise TooLargeError(
            f"the table of constraint {key} has {entries:,} entries, more than {MAX_TUPLES:,}: split the constraint,"
            " or choose another protocol"
        )


def _plain(domain: Domain) -> Domain | range:
    """Return the possible values of `domain` as a range, which is faster, if they are a single range."""
    possible = domain.possible
    return domain.ranges[0] if possible is domain and len(domain.ranges) == 1 else possible


class SharedConstraint:
    """A constraint on this robot's compiled variable and the compiled variables of `agents` (in priority order).

    After `compile` it returns the values of this robot that are consistent with values of the others. Answers are
    computed on first use and cached: one for each combination of the others' variables in the constraint, however many
    values their robots have. Equal constraints of the robots in this process share the cache (`evaluations`).

    Args:
        key: The constraint's name in explanations.
        constraint: The constraint.
        known: The common knowledge of all robots.
        own: The robot that checks.
    """

    def __init__(self, key: str, constraint: Constraint, known: TeamKnowledge, own: str) -> None:
        self.key = key
        scope = set(constraint.variables)
        owners = {known.owners[name] for name in scope if name in known.owners} - {own}
        self.agents = tuple(sorted(owners, key=known.rank.__getitem__))
        interfaces = known.interfaces
        self._constraint = constraint
        self._scope = scope
        self._known = known
        self._seen = [
            (agent, place) for agent in self.agents for place, name in enumerate(interfaces[agent]) if name in scope
        ]
        self._names = [interfaces[agent][place] for agent, place in self._seen]
        self._domains: list[Domain | range] | None = [_plain(known.domains[name]) for name in self._names]
        """The domains of the others' variables. None: any value is evaluated."""
        self._widths = {agent: len(interfaces[agent]) for agent in self.agents}
        self._only = self._seen[0] if len(self._seen) == 1 else None
        self._masks_by: dict[int, int] = {}
        """If the others have one variable: the cache of `mask`, by the variable's value."""
        self._masks: dict[OtherValues, int] = {}
        self._masks_on: dict[tuple[tuple[Value, ...], ...], list[int]] = {}
        self._costs_by: dict[int, list[Cost]] = {}
        """If the others have one variable: the cache of `costs`, by the variable's value."""
        self._conflicts: dict[OtherValues, Conflict] = {}
        self._counts_when_absent = False
        self._test: Callable[[Sequence[int]], bool] | None = None
        self._price: Callable[[Sequence[int]], Cost] | None = None
        self._restated: dict[tuple[str, ...], Callable[[Sequence[int]], Cost] | None] = {}
        """The costs of the constraint if the owners of these variables are absent. None: the constraint is dropped."""

    def __deepcopy__(self, _: object) -> SharedConstraint:
        """Return a copy with its own record of evaluated combinations, which are counted. All results are shared."""
        twin = copy(self)
        twin._masks = dict(self._masks)  # noqa: SLF001 - of the same class
        return twin

    def allow_absence(self) -> None:
        """Accept None as the value of withdrawn robots from now on (`model/absence.py`)."""
        self._counts_when_absent = may_count_when_absent(self._constraint)
        self._stop_sharing()

    def compile(self, own: OwnValues) -> None:
        """Compile the constraint for this robot's domain."""
        self._own = own
        self._places, names = own.seen(self._scope)
        self._all_names = [*self._names, *names]
        _, self.codes, self._distinct = own.axis(self._places)
        self._code_values = own.code_values(self._places)
        shared = self._known.evaluations
        domains = tuple([self._known.domains[name].ranges for name in self._names])
        self.evaluations = shared.of(self._constraint, self._all_names, (domains, own.number(self._places, shared)))
        self._costs = self.evaluations.costs

    def _stop_sharing(self) -> None:
        """Evaluate this constraint alone from now on: it may accept other values than equal constraints."""
        self.evaluations = Evaluations(self._constraint.definition)
        self._costs = dict(self._costs)

    @property
    def seen(self) -> tuple[tuple[int, int], ...]:
        """The other robots' variables in the scope: the index of each robot in `agents`, and of its variable."""
        return tuple([(self.agents.index(agent), place) for agent, place in self._seen])

    @property
    def names_all(self) -> bool:
        """True if the constraint names all interface variables of its robots."""
        return len(self._all_names) == sum(self._widths.values()) + self._own.width

    @property
    def places(self) -> tuple[tuple[int, ...], ...]:
        """For each robot in `agents`, then for this robot: its variables in the scope, as in `Axis`."""
        others = [tuple([place for owner, place in self._seen if owner == agent]) for agent in self.agents]
        return (*others, self._places)

    def other_values(self, view: Mapping[str, Value]) -> OtherValues | None:
        """Return the values of the scope in `view`. None: a value is unknown, or the constraint is dropped."""
        try:
            seen = [view[agent][place] for agent, place in self._seen]
        except KeyError:
            return None
        except IndexError:
            raise self._refusal_of_width(view) from None
        return None if None in seen and not self._counts_when_absent else tuple(seen)

    def combined(self, sets: Mapping[str, Sequence[Value]]) -> Iterator[OtherValues]:
        """Yield all combinations of the others' variables, for the values of each other robot in `sets`.

        Yields nothing if a robot has no values there. Equal combinations are yielded once.
        """
        columns = []
        for agent in self.agents:
            places = [place for owner, place in self._seen if owner == agent]
            shown = dict.fromkeys(tuple([value[place] for place in places]) for value in sets.get(agent, ()))
            columns.append([part for part in shown if None not in part])
        for parts in itertools.product(*columns):
            yield tuple(itertools.chain.from_iterable(parts))

    def allow_undeclared(self) -> None:
        """Evaluate undeclared values of others from now on."""
        self._domains = None
        self._stop_sharing()

    def _refuse_undeclared(self, others: OtherValues) -> None:
        """Raise `ValueError` if a value, which a message may contain, is not in the declared domain of its robot.

        Called when `others` is evaluated, and so once for each combination.
        """
        if self._domains is None:
            return
        for place, domain in enumerate(self._domains):
            if others[place] is not None and others[place] not in domain:
                raise ValueError(f"{self._names[place]} of {self._seen[place][0]} cannot be {others[place]}")

    def _refusal_of_width(self, view: Mapping[str, Value]) -> ValueError:
        """Return the error for a value in `view` with too few parts."""
        short = [agent for agent, width in self._widths.items() if agent in view and len(view[agent]) < width]
        return ValueError(f"a value of {short[0]} has {self._widths[short[0]]} parts, not {len(view[short[0]])}")

    def holds(self, others: OtherValues) -> list[bool]:
        """Return, for each code of own values, whether it is consistent with `others`. Raises `ValueError`."""
        self._refuse_undeclared(others)
        return [self._holds((*others, *own)) for own in self._distinct]

    def _holds(self, values: Sequence[int | None]) -> bool:
        """Return whether the constraint holds on `values`, which are None for withdrawn robots."""
        if None in values:
            return self._cost_for_some(values) < INFINITE
        if self._test is None:
            self._test = allows_function(self._constraint, self._all_names)
        return self._test(values)  # type: ignore[arg-type]

    def _cost(self, values: Sequence[int | None]) -> Cost:
        """Return the cost of the constraint on `values`, which are None for withdrawn robots."""
        if None in values:
            return self._cost_for_some(values)
        if self._price is None:
            self._price = cost_function(self._constraint, self._all_names)
        return self._price(values)  # type: ignore[arg-type]

    def _cost_for_some(self, values: Sequence[int | None]) -> Cost:
        """Return the cost of the constraint with withdrawn robots; 0 if it is dropped."""
        if not self._counts_when_absent:
            return 0
        paired = list(zip(self._all_names, values, strict=True))
        absent = tuple([name for name, value in paired if value is None])
        if absent not in self._restated:
            left = restated(self._constraint, absent)
            present = [name for name, value in paired if value is not None]
            self._restated[absent] = None if left is None else cost_function(left, present)
        price = self._restated[absent]
        return 0 if price is None else price([value for value in values if value is not None])

    @property
    def definition(self) -> object:
        """The constraint as defined in the files: equal constraints have equal costs."""
        return self._constraint

    @property
    def max_cost(self) -> Cost:
        """The maximum finite cost."""
        return max_cost(self._constraint)

    def costs(self, others: OtherValues) -> list[Cost]:
        """Return the cost of each own value together with the values `others`. Raises `ValueError`."""
        prices = self._costs.get(others)
        if prices is None:
            self._refuse_undeclared(others)
            paid: list[Cost] = [self._cost((*others, *own)) for own in self._distinct]
            prices = self._costs[others] = [paid[code] for code in self.codes]
        return prices

    def costs_in(self, view: Mapping[str, Value]) -> list[Cost] | None:
        """Return the cost of each own value in `view`. None: a value is unknown, or the constraint is dropped."""
        if self._only is None:
            others = self.other_values(view)
            return None if others is None else self.costs(others)
        agent, place = self._only
        value = view.get(agent)
        if value is None:
            return None
        try:
            part = value[place]
        except IndexError:
            raise self._refusal_of_width(view) from None
        if part is None:
            return self.costs((None,)) if self._counts_when_absent else None
        prices = self._costs_by.get(part)
        if prices is None:
            prices = self._costs_by[part] = self.costs((part,))
        return prices

    def cost_at(self, others: OtherValues, own: Value) -> Cost:
        """Return the cost of the own value `own`, which need not be in the compiled domain. Nothing is stored."""
        return self._cost((*others, *[own[place] for place in self._places]))

    @property
    def counts_when_absent(self) -> bool:
        """True if the constraint may cost something when some of its robots have withdrawn."""
        return self._counts_when_absent

    def cost_array(
        self, columns: Sequence[Sequence[Value]], absent: Container[int] = frozenset()
    ) -> NDArray[float64] | None:
        """Return the costs for all combinations of `columns`, the parts of the others' and then of this robot's values.

        The columns at `absent` have a single part: the robot has withdrawn. No other part may be None. The result is
        None if the combinations must be evaluated one by one.

        Raises:
            ValueError: if a value is undeclared.
        """
        from robochoc.solver.constraint_arrays import cost_array, no_costs  # noqa: PLC0415 - numpy, for large tables

        if not all(columns):
            return None
        least = [column[0] for column in columns[:-1]]
        for place, column in enumerate(columns[:-1]):
            for part in column:
                self._refuse_undeclared(tuple(itertools.chain(*least[:place], part, *least[place + 1 :])))
        names = iter(self._all_names)
        named = [[next(names) for _ in column[0]] for column in columns]
        gone = [name for place, owned in enumerate(named) if place in absent for name in owned]
        constraint = restated(self._constraint, gone) if gone else self._constraint
        present = [place for place in range(len(columns)) if place not in absent]
        shape = [1 if place in absent else len(column) for place, column in enumerate(columns)]
        if constraint is None:
            return no_costs(shape)
        left = [name for place in present for name in named[place]]
        found = cost_array(constraint, left, [columns[place] for place in present])
        return None if found is None else found.reshape(shape)

    def row_costs(self, domains: Mapping[str, Sequence[Value]]) -> RowCosts | None:
        """Return the constraint for evaluation row by row, with this robot last; None if this is not supported.

        Raises:
            ValueError: if a value is undeclared.
        """
        from robochoc.solver.constraint_arrays import RowCosts  # noqa: PLC0415 - as above

        columns: list[Sequence[Value]] = []
        for agent in self.agents:
            places = [place for owner, place in self._seen if owner == agent]
            columns.append([tuple([value[place] for place in places]) for value in domains[agent]])
        columns.append([self._distinct[code] for code in self.codes])
        if not all(columns) or any(None in part for column in columns for part in column):
            return None
        least = [column[0] for column in columns[:-1]]
        for place, column in enumerate(columns[:-1]):
            for part in dict.fromkeys(column):
                self._refuse_undeclared(tuple(itertools.chain(*least[:place], part, *least[place + 1 :])))
        found = RowCosts(self._constraint, self._all_names, columns)
        return None if found.most is None else found

    def lower_bounds(self, domains: Mapping[str, Iterable[int]], wide: int) -> tuple[int, list[Cost]]:
        """Return the number of checks, and a lower bound on the cost of each own value over the others' `domains`.

        With more than `wide` combinations, the bound is 0 without checks.
        """
        least: list[Cost] = [0] * len(self.codes)
        columns = [list(domains[name]) for name in self._names]
        if math.prod(map(len, columns)) * len(least) > wide:
            return 0, least
        checks = 0
        for number, others in enumerate(itertools.product(*columns)):
            prices = self.costs(others)
            least = list(map(min, least, prices)) if number else prices
            checks += len(prices)
            if not any(least):
                break
        return checks, least

    def least_and_most(self, domains: Mapping[str, Iterable[int]], wide: int) -> tuple[int, Cost, Cost]:
        """Return the number of checks, and the minimum and maximum cost over the others' `domains`.

        With more than `wide` combinations, nothing is checked: the results are 0 and the constraint's maximum cost.
        """
        columns = [list(domains[name]) for name in self._names]
        entries = math.prod(map(len, columns)) * len(self.codes)
        if not 0 < entries <= wide:
            return 0, 0, self.max_cost if is_soft(self._constraint) else INFINITE
        rows = [self.costs(others) for others in itertools.product(*columns)]
        return entries, min(map(min, rows)), max(map(max, rows))

    def axes(self, domains: Mapping[str, Sequence[Value]]) -> list[Axis]:
        """Return the axes of the constraint's table: one for each other robot with its values in `domains`, own last.

        Raises:
            TooLargeError: if the table is too large.
            ValueError: if a value has too few parts.
        """
        found = []
        for agent, places in zip(self.agents, self.places[:-1], strict=True):
            try:
                found.append(axis(domains[agent], places))
            except IndexError:
                short = next(value for value in domains[agent] if len(value) <= places[-1])
                raise self._refusal_of_width({agent: short}) from None
        found.append(Axis(self._places, self.codes, self._distinct))
        refuse_large(self.key, math.prod(len(one.parts) for one in found))
        return found

    def combinations(self, axes: Iterable[Axis]) -> Iterator[tuple[tuple[int, ...], OtherValues]]:
        """Yield, for each combination of the others' `axes`, its indices on them and the values in the scope.

        Combinations that drop the constraint are skipped.
        """
        parts = [one.parts for one in axes]
        places = itertools.product(*(range(len(column)) for column in parts))
        for place, chosen in zip(places, itertools.product(*parts), strict=True):
            others = tuple(itertools.chain.from_iterable(chosen))
            if None not in others or self._counts_when_absent:
                yield place, others

    def distinct_costs(self, others: OtherValues) -> list[Cost]:
        """Return the cost of each own value that the constraint distinguishes, together with the values `others`."""
        if len(self._distinct) == len(self.codes):
            return self.costs(others)
        self._refuse_undeclared(others)
        return [self._cost((*others, *own)) for own in self._distinct]

    def mask(self, others: OtherValues) -> int:
        """Return this robot's values that are consistent with `others`: bit i for the i-th value."""
        mask = self._masks.get(others)
        if mask is None:
            mask = self.evaluations.masks.get(others)
            if mask is None:
                holds = self.holds(others)
                mask = sum([values for values, allowed in zip(self._code_values, holds, strict=True) if allowed])
                self.evaluations.masks[others] = mask
            self._masks[others] = mask
        return mask

    def declared(self, domains: Mapping[str, Iterable[int]], most: int) -> Iterable[OtherValues]:
        """Return all combinations of the others' declared `domains`; none if there are more than `most`."""
        columns = [list(domains[name]) for name in self._names]
        return itertools.product(*columns) if math.prod(map(len, columns)) <= most else ()

    def evaluate(self, combinations: Iterable[OtherValues]) -> int:
        """Evaluate `combinations`, and return the number of combinations that had not been evaluated before."""
        before = len(self._masks)
        for others in combinations:
            self.mask(others)
        return len(self._masks) - before

    def masks_on(self, axes: Sequence[Axis], at_once: int) -> tuple[int, Sequence[int]]:
        """Return the number of combinations that had not been evaluated before, and the mask of each combination.

        The combinations, those of the others' `axes`, are in the order of `itertools.product`. More than `at_once` rows
        of a table over the robots' values are evaluated and stored together.
        """
        *others, own = axes
        if math.prod([len(one.parts) for one in others]) * len(own.codes) > at_once:
            key = tuple([tuple(one.parts) for one in others])
            known = self._masks_on.get(key)
            if known is not None:
                return 0, known
            costs = self.cost_array([one.parts for one in axes])
            if costs is not None:
                masks = self._masks_on[key] = self._masks_in(costs)
                return len(masks), masks
        combinations = [combination for _, combination in self.combinations(others)]
        return self.evaluate(combinations), [self.mask(combination) for combination in combinations]

    def _masks_in(self, costs: NDArray[float64]) -> list[int]:
        """Return the mask of each row of `costs`. Equal masks are one object."""
        from robochoc.solver.constraint_arrays import rows_of_bits  # noqa: PLC0415 - as above

        known: dict[bytes, int] = {}
        masks = []
        for row in rows_of_bits(costs):
            if row not in known:
                codes = int.from_bytes(row, "little")
                known[row] = sum([mask for at, mask in enumerate(self._code_values) if codes >> at & 1])
            masks.append(known[row])
        return masks

    def mask_in(self, view: Mapping[str, Value]) -> int:
        """Return `mask` for the values in `view`. `UNKNOWN` if `other_values` is None."""
        if self._only is None:
            others = self.other_values(view)
            return UNKNOWN if others is None else self.mask(others)
        agent, place = self._only
        value = view.get(agent)
        if value is None:
            return UNKNOWN
        try:
            part = value[place]
        except IndexError:
            raise self._refusal_of_width(view) from None
        if part is None:
            return self.mask((None,)) if self._counts_when_absent else UNKNOWN
        mask = self._masks_by.get(part)
        if mask is None:
            mask = self._masks_by[part] = self.mask((part,))
        return mask

    def conflict_with(self, view: Mapping[str, Value]) -> Conflict:
        """Return the result of `conflict` for the values in `view`, which must be known."""
        others = self.other_values(view)
        assert others is not None  # noqa: S101 - for mypy
        return self.conflict(others)

    def own_part(self, index: int) -> Value:
        """Return the value at `index`, with None for variables outside the constraint."""
        return self._own.shown(index, self._places)

    def row(self, index: int, columns: Sequence[Sequence[int]]) -> tuple[int, list[bool]]:
        """Return which values of the single other robot are consistent with this robot's value at `index`.

        `columns` are the values of that robot's variables; the results follow their product, as in `itertools`. Every
        pair that the constraint distinguishes is evaluated once, whatever the results are. The first item returned is
        the number of checks.
        """
        own = self._distinct[self.codes[index]]
        places = [place for _, place in self._seen]
        pairs = itertools.product(*(columns[place] for place in places))
        holds = {others: self._holds((*others, *own)) for others in pairs}
        values = itertools.product(*columns)
        return len(holds), [holds[tuple([value[place] for place in places])] for value in values]

    def conflict(self, others: OtherValues) -> Conflict:
        """Return `others` as the left side of a nogood. Equal calls share one object, which must not be modified."""
        conflict = self._conflicts.get(others)
        if conflict is None:
            parts: dict[str, list[int | None]] = {agent: [None] * self._widths[agent] for agent in self.agents}
            for (agent, place), value in zip(self._seen, others, strict=True):
                parts[agent][place] = value
            conflict = self._conflicts[others] = {agent: tuple(value) for agent, value in parts.items()}
        return conflict


def sorted_by_lowest_agent(
    constraints: Iterable[SharedConstraint], rank: Mapping[str, int]
) -> tuple[SharedConstraint, ...]:
    """Return `constraints` in the order of their lowest other robots, the highest first."""
    return tuple(
        sorted(constraints, key=lambda c: (max((rank[agent] for agent in c.agents), default=-1), len(c.agents)))
    )


def by_robot(constraints: Iterable[SharedConstraint]) -> dict[str, list[SharedConstraint]]:
    """Return the constraints with a single other robot, by its name."""
    found: dict[str, list[SharedConstraint]] = {}
    for constraint in constraints:
        if len(constraint.agents) == 1:
            found.setdefault(constraint.agents[0], []).append(constraint)
    return found
