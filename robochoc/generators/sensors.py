"""SensorDCSP: each target is tracked by several sensors that see it and hear each other; a sensor tracks one at most.

Bejar, Domshlak, Fernandez, Gomes, Krishnamachari, Selman and Valls, "Sensor networks and distributed CSP:
communication, computation and complexity", AIJ 161 (2005); CSPLib, problem 72. Three sensors triangulate a target.

* `sensors`, SensorDCSP: targets are visible to sensors, and pairs of sensors are compatible, with given probabilities.
* `grid_sensors`, GSensorDCSP: sensors are on the nodes of a grid and targets in its cells, at most one per cell.
  Sensors see and hear up to given distances; each of these links exists with a given probability.

There are two models, and a problem is satisfiable in both or in neither:

* `targets` (in the paper; TaV in CSPLib): a robot is a target, with a variable for each sensor that it needs; the
  values are sensors. The values of a target's variables are different and compatible (private constraints). Variables
  of different targets have different values.
* `sensors` (like SaV in CSPLib): a robot is a sensor with one variable: the target that it tracks, or 0. At least the
  needed number of sensors track a target (a constraint over all sensors that see it), and no two of these are
  incompatible.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from enum import StrEnum
from typing import assert_never

from robochoc.formats import PREDEFINED
from robochoc.generators.draws import MAX_AGENTS, check_bounds, limited, sample, seeded
from robochoc.model.assembly import assemble
from robochoc.model.expression import Apply, Constant, Name, Type, parse, total
from robochoc.model.problem import Constraint, Domain, Predicate, Relation, Semantics, Team, Term, Variable
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.suggestions import member

MAX_NEEDED = 10
MAX_PAIRS = 1_000_000
"""The maximum number of pairs of sensors that see the same target, summed over all targets."""

NOT_BOTH = Predicate("notBoth", ("X", "Y", "t"), parse("or(ne(X, t), ne(Y, t))", ("X", "Y", "t"), Type.BOOLEAN))
"""X and Y do not both track the target t."""


class SensorsModel(StrEnum):
    """The meaning of a robot: a target, or a sensor."""

    TARGETS = "targets"
    SENSORS = "sensors"


@dataclass(frozen=True)
class Reach:
    """The distances at which sensors on a grid see and hear.

    Attributes:
        sight: The range of sight: 1 for the four cells around a sensor, 2 for sixteen cells, and so on.
        hearing: The maximum number of steps, along the grid or diagonally, to a sensor that is heard.
        visibility: The probability that a sensor sees a target within its range.
        compatibility: The probability that two sensors within range of each other are compatible.
    """

    sight: int = 1
    hearing: int = 1
    visibility: float = 1
    compatibility: float = 1


@dataclass(frozen=True)
class SensorNetwork:
    """The targets that sensors see, and the other sensors that they hear.

    Attributes:
        sensors: The number of sensors, which are numbered from 1.
        seen_by: The sensors that see each target, in ascending order.
        compatible: The pairs of sensors that hear each other, the smaller number first.
        needed: The number of sensors that a target needs.
    """

    sensors: int
    seen_by: Sequence[Sequence[int]]
    compatible: frozenset[tuple[int, int]]
    needed: int


def sensors(
    sensors: int,
    targets: int,
    seed: int = 0,
    *,
    visibility: float = 0.5,
    compatibility: float = 0.5,
    needed: int = 3,
    model: SensorsModel | str = SensorsModel.TARGETS,
) -> Team:
    """Return a random SensorDCSP problem.

    Args:
        sensors: The number of sensors.
        targets: The number of targets.
        seed: The same seed gives the same problem on every machine, in both models.
        visibility: The probability that a sensor sees a target.
        compatibility: The probability that two sensors are compatible.
        needed: The number of sensors that a target needs.
        model: The meaning of a robot.

    Raises:
        ValueError: if a number is out of its bounds, or no sensor sees a target.
    """
    check_bounds({"sensors": (sensors, 1, MAX_AGENTS), "targets": (targets, 1, MAX_AGENTS)})
    _check_shares(visibility, compatibility, needed)
    chance = seeded(seed)
    numbers = range(1, sensors + 1)
    seen_by = [[one for one in numbers if chance.random() < visibility] for _ in range(targets)]
    pairs = itertools.combinations(numbers, 2)
    compatible = frozenset(pair for pair in pairs if chance.random() < compatibility)
    shares = f"{float(visibility)}-{float(compatibility)}"
    model = member(SensorsModel, "model", model)
    name = f"sensors-{model}-{sensors}-{targets}-{needed}-{shares}-{seed}"
    return _team(name, SensorNetwork(sensors, seen_by, compatible, needed), model)


def grid_sensors(
    rows: int,
    columns: int,
    targets: int,
    seed: int = 0,
    *,
    reach: Reach = Reach(),
    needed: int = 3,
    model: SensorsModel | str = SensorsModel.TARGETS,
) -> Team:
    """Return a random GSensorDCSP problem.

    Sensors are numbered row by row. The cells between sensors have one row and one column fewer.

    Args:
        rows: The number of rows of sensors.
        columns: The number of columns of sensors.
        targets: The number of targets, each in the middle of a different cell.
        seed: The same seed gives the same problem on every machine, in both models.
        reach: The distances at which sensors see and hear.
        needed: The number of sensors that a target needs.
        model: The meaning of a robot.

    Raises:
        ValueError: if a number is out of its bounds, or no sensor sees a target.
    """
    check_bounds({"rows": (rows, 2, MAX_AGENTS), "columns": (columns, 2, MAX_AGENTS)})
    cells = (rows - 1) * (columns - 1)
    check_bounds({"rows x columns": (rows * columns, 4, MAX_AGENTS), "targets": (targets, 1, cells)})
    sight, hearing = reach.sight, reach.hearing
    check_bounds({"sight": (sight, 1, MAX_AGENTS), "hearing": (hearing, 1, MAX_AGENTS)})
    _check_shares(reach.visibility, reach.compatibility, needed)
    chance = seeded(seed)
    nodes = list(itertools.product(range(rows), range(columns)))
    seen_by = []
    for cell in sample(chance, cells, targets):
        row, column = divmod(cell, columns - 1)  # its upper left node
        near = (
            number
            for number, (i, j) in enumerate(nodes, 1)
            if -sight < i - row <= sight and -sight < j - column <= sight
        )
        seen_by.append([number for number in near if chance.random() < reach.visibility])
    compatible = frozenset(
        (one + 1, other + 1)
        for one, other in itertools.combinations(range(len(nodes)), 2)
        if max(abs(a - b) for a, b in zip(nodes[one], nodes[other], strict=True)) <= hearing
        and chance.random() < reach.compatibility
    )
    shares = f"{sight}-{hearing}-{float(reach.visibility)}-{float(reach.compatibility)}"
    model = member(SensorsModel, "model", model)
    name = f"grid-sensors-{model}-{rows}x{columns}-{targets}-{needed}-{shares}-{seed}"
    return _team(name, SensorNetwork(len(nodes), seen_by, compatible, needed), model)


def _check_shares(visibility: float, compatibility: float, needed: int) -> None:
    check_bounds({"visibility": (visibility, 0, 1), "compatibility": (compatibility, 0, 1)})
    check_bounds({"needed": (needed, 1, MAX_NEEDED)})


def _team(name: str, network: SensorNetwork, model: SensorsModel) -> Team:
    for target, seen in enumerate(network.seen_by, 1):
        if not seen:
            raise ValueError(f"no sensor sees target {target}; use another seed, or increase the sight or visibility")
    pairs = sum(len(seen) ** 2 for seen in network.seen_by)
    if pairs > MAX_PAIRS:
        raise ValueError(f"{pairs:,} pairs of sensors see the same target, more than {MAX_PAIRS:,}; use fewer sensors")
    match model:
        case SensorsModel.TARGETS:
            variables, constraints = _of_targets(network)
        case SensorsModel.SENSORS:
            variables, constraints = _of_sensors(network)
        case never:
            assert_never(never)
    return assemble(name, variables, limited(constraints))


_Parts = tuple[dict[str, list[Variable]], Iterator[Constraint]]
"""The variables of each robot, and the constraints."""


def _of_targets(network: SensorNetwork) -> _Parts:
    variables = {
        f"Target{target}": [
            Variable(f"S{target}.{place}", Domain(f"Seen{target}", tuple(range(one, one + 1) for one in seen)))
            for place in range(1, network.needed + 1)
        ]
        for target, seen in enumerate(network.seen_by, 1)
    }

    def constraints() -> Iterator[Constraint]:
        for target, seen in enumerate(network.seen_by, 1):
            pairs = [pair for pair in itertools.combinations(seen, 2) if pair in network.compatible]
            rows = tuple(sorted([*pairs, *((other, one) for one, other in pairs)]))
            together = Relation(f"Compatible{target}", 2, Semantics.SUPPORTS, rows)
            for pair in itertools.combinations([one.name for one in variables[f"Target{target}"]], 2):
                yield Constraint("compatible", together, pair, pair)
        for one, other in itertools.combinations(range(len(network.seen_by)), 2):
            if not set(network.seen_by[one]).isdisjoint(network.seen_by[other]):
                sides = ([variable.name for variable in variables[f"Target{place + 1}"]] for place in (one, other))
                for scope in itertools.product(*sides):
                    yield Constraint("different", PREDEFINED["ne"], scope, scope)

    return variables, constraints()


def _of_sensors(network: SensorNetwork) -> _Parts:
    tracked: dict[int, list[int]] = {sensor: [] for sensor in range(1, network.sensors + 1)}
    for target, seen in enumerate(network.seen_by, 1):
        for sensor in seen:
            tracked[sensor].append(target)
    variables = {
        f"Sensor{sensor}": [Variable(f"T{sensor}", Domain("D", tuple(range(one, one + 1) for one in (0, *targets))))]
        for sensor, targets in tracked.items()
    }

    def constraints() -> Iterator[Constraint]:
        for target, seen in enumerate(network.seen_by, 1):
            scope: tuple[Term, ...] = (*(f"T{sensor}" for sensor in seen), target, network.needed)
            yield Constraint(f"tracked{target}", _at_least(len(seen)), scope, scope)
            for one, other in itertools.combinations(seen, 2):
                if (one, other) not in network.compatible:
                    terms = (f"T{one}", f"T{other}", target)
                    yield Constraint("apart", NOT_BOTH, terms, terms)

    return variables, constraints()


def _at_least(count: int) -> Predicate:
    """Return the predicate that at least k of `count` sensors track the target t."""
    names = [f"X{number}" for number in range(1, count + 1)]
    ones = (Apply("if", (Apply("eq", (Name(name), Name("t"))), Constant(1), Constant(0))) for name in names)
    return Predicate(f"atLeast{count}", (*names, "t", "k"), Apply("ge", (total(ones), Name("k"))))
