"""The problems of the part `choice`: families whose sizes and difficulties are drawn from a seed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import combinations
from random import Random

from robochoc.generators.draws import sample
from robochoc.generators.families import FAMILIES
from robochoc.model.assembly import assemble
from robochoc.model.problem import Constraint, Domain, Relation, Semantics, Team, Variable


def problem(family: str, seed: int) -> Team:
    """Return the problem of `family` with `seed`, which determines its parameters too."""
    return PROBLEMS[family](Random(f"{family} {seed}"))


def _size(chance: Random, least: int, most: int) -> int:
    """Return a number from `least` to `most`; its logarithm is uniform."""
    return round(math.exp(chance.uniform(math.log(least), math.log(most))))


def _random(
    chance: Random, robots: tuple[int, int], values: tuple[int, int], degree: tuple[float, float],
    kappa: tuple[float, float],
) -> Team:  # fmt: skip
    """Return a random binary problem. `kappa` is its constrainedness (`robochoc.run.facts`)."""
    agents, domain = _size(chance, *robots), _size(chance, *values)
    density = min(1.0, chance.uniform(*degree) / (agents - 1))
    edges = round(density * agents * (agents - 1) / 2)
    tightness = 1 - 2 ** (-chance.uniform(*kappa) * agents * math.log2(domain) / max(edges, 1))
    return _family("random", chance, agents=agents, domain=domain, density=density, tightness=tightness)


def _costly(chance: Random, robots: tuple[int, int], degree: tuple[float, float], tightness: float = 0) -> Team:
    """Return a random DCOP in which constraints forbid a fraction of at most `tightness` of the pairs of values."""
    agents = _size(chance, *robots)
    density = min(1.0, chance.uniform(*degree) / (agents - 1))
    some = {"agents": agents, "domain": chance.randint(2, 6), "density": density, "max_cost": 100}
    return _family("random", chance, **some, tightness=chance.uniform(0, tightness))


def _family(name: str, chance: Random, **parameters: object) -> Team:
    """Return a problem of one of robochoc's families. Other seeds are tried if a seed gives no problem."""
    for _ in range(100):
        try:
            return FAMILIES[name](**parameters, seed=chance.randrange(10**6))
        except ValueError as error:
            why = error
    raise why


def _colouring(chance: Random, robots: tuple[int, int], colours: tuple[int, int], share: tuple[float, float]) -> Team:
    """Return a colouring of a random graph. `share` is the degree over the one at which no colouring is left."""
    colors = chance.randint(*colours)
    threshold = 2 * colors * math.log(colors) - math.log(colors) - 1 / 2
    degree = chance.uniform(*share) * threshold
    agents = max(_size(chance, *robots), round(2 * degree))
    return _family("coloring", chance, agents=agents, colors=colors, degree=degree, conflicts="hard")


def _graph_colouring(chance: Random, graph: str, conflicts: str, robots: tuple[int, int]) -> Team:
    agents, colors = _size(chance, *robots), chance.randint(3, 4)
    more: dict[str, object] = {}
    if graph == "grid":
        rows = max(2, _size(chance, 2, max(2, math.isqrt(agents))))
        agents, more = rows * max(2, agents // rows), {"rows": rows, "torus": rows > 2 and chance.random() < 1 / 2}
    elif graph == "scale-free":
        more = {"links": chance.randint(1, 3)}
    elif graph == "small-world":
        more = {"neighbours": chance.choice((2, 4)), "rewiring": chance.random()}
    return _family("coloring", chance, agents=agents, colors=colors, graph=graph, conflicts=conflicts, **more)


def _ternary(chance: Random) -> Team:
    """Return a random problem with constraints over three variables with domains of different sizes."""
    agents = _size(chance, 8, 40)
    domains = [Domain(f"D{size}", (range(size),)) for size in range(2, 7)]
    variables = {f"Robot{number}": [Variable(f"V{number}", chance.choice(domains))] for number in range(agents)}
    bits = sum(math.log2(len(own.domain)) for (own,) in variables.values())
    count = round(agents * chance.uniform(0.6, 1.2))
    allowed = 2 ** (-chance.uniform(0.2, 1.2) * bits / count)
    constraints = []
    for number in range(count):
        scope = [variables[f"Robot{one}"][0] for one in sample(chance, agents, 3)]
        columns = [range(len(one.domain)) for one in scope]
        rows = [(a, b, c) for a in columns[0] for b in columns[1] for c in columns[2] if chance.random() > allowed]
        names = tuple(one.name for one in scope)
        constraints.append(
            Constraint(f"C{number}", Relation(f"R{number}", 3, Semantics.CONFLICTS, tuple(rows)), names, names)
        )
    return assemble(f"ternary-{agents}", variables, constraints)


def _queens(chance: Random) -> Team:
    """Return the n queens problem, with a robot for each row."""
    n = _size(chance, 8, 24)
    values = Domain("Columns", (range(n),))
    variables = {f"Robot{row}": [Variable(f"V{row}", values)] for row in range(n)}
    constraints = []
    relations = {
        far: Relation(
            f"Attacks{far}", 2, Semantics.CONFLICTS,
            tuple((one, other) for one in range(n) for other in range(n) if abs(one - other) in {0, far}),
        )
        for far in range(1, n)
    }  # fmt: skip
    for one, other in combinations(range(n), 2):
        scope = (f"V{one}", f"V{other}")
        constraints.append(Constraint(f"C{one}.{other}", relations[other - one], scope, scope))
    return assemble(f"queens-{n}", variables, constraints)


def _meetings(chance: Random, model: str, *, required: bool) -> Team:
    persons = _size(chance, 8, 30 if required else 12)
    meetings = max(8, round(persons * chance.uniform(0.6, 1.5 if required else 1)))
    return _family(
        "meetings", chance, agents=persons, meetings=meetings, slots=chance.randint(4, 8), model=model,
        participants=min(persons, chance.randint(2, 3)), required=required,
    )  # fmt: skip


def _sensors(chance: Random, model: str, targets: int, each: float) -> Team:
    """Return a problem with `targets`, and `each` times as many sensors."""
    return _family(
        "sensors", chance, sensors=round(targets * each), targets=targets, model=model, needed=2,
        visibility=chance.uniform(0.4, 0.8), compatibility=chance.uniform(0.6, 0.95),
    )  # fmt: skip


def _tree(chance: Random, max_cost: int | None) -> Team:
    return _family(
        "random", chance, agents=_size(chance, 8, 2000 if max_cost is None else 1000), domain=chance.randint(3, 10),
        graph="tree", tightness=chance.uniform(0.1, 0.6) if max_cost is None else 0, max_cost=max_cost,
    )  # fmt: skip


def _ladder(chance: Random) -> Team:
    rows = chance.randint(2, 3)
    agents = rows * _size(chance, 4, 12)
    return _family("random", chance, agents=agents, rows=rows, domain=3, graph="grid", max_cost=100)


PROBLEMS: Mapping[str, Callable[[Random], Team]] = {
    "random small": lambda chance: _random(chance, (8, 20), (3, 8), (3, 8), (0.3, 1.3)),
    "random sparse": lambda chance: _random(chance, (20, 70), (3, 8), (3, 5), (0.3, 0.9)),
    "random dense": lambda chance: _random(chance, (15, 30), (4, 10), (8, 25), (0.4, 0.8)),
    "random large domains": lambda chance: _random(chance, (8, 40), (20, 80), (2, 6), (0.3, 0.8)),
    "random large": lambda chance: _random(chance, (200, 2000), (3, 6), (2, 6), (0.2, 0.55)),
    "random large dense": lambda chance: _random(chance, (150, 600), (4, 8), (8, 15), (0.2, 0.5)),
    "random unsolvable": lambda chance: _random(chance, (10, 40), (3, 8), (4, 12), (1.2, 2)),
    "colouring small": lambda chance: _colouring(chance, (12, 100), (3, 3), (0.4, 1.0)),
    "colouring many colours": lambda chance: _colouring(chance, (30, 300), (4, 8), (0.3, 0.7)),
    "colouring large": lambda chance: _colouring(chance, (300, 2000), (3, 8), (0.3, 0.75)),
    "colouring unsolvable": lambda chance: _colouring(chance, (20, 100), (3, 4), (1.1, 1.5)),
    "colouring scale-free": lambda chance: _graph_colouring(chance, "scale-free", "hard", (15, 1500)),
    "colouring grid": lambda chance: _graph_colouring(chance, "grid", "hard", (12, 1500)),
    "colouring small-world": lambda chance: _graph_colouring(chance, "small-world", "hard", (12, 800)),
    "trees": lambda chance: _tree(chance, None),
    "ternary": _ternary,
    "queens": _queens,
    "3D queens": lambda chance: FAMILIES["queens3d"](n=chance.randint(3, 9), model=chance.choice(("planar", "full"))),
    "meetings": lambda chance: _meetings(chance, "eav", required=True),
    "meetings by person": lambda chance: _meetings(chance, "peav", required=True),
    "sensor targets": lambda chance: _sensors(chance, "targets", _size(chance, 8, 14), chance.uniform(4, 8)),
    "sensors": lambda chance: _sensors(chance, "sensors", chance.randint(2, 4), chance.uniform(4, 6)),
    "costs small": lambda chance: _costly(chance, (8, 14), (2, 6)),
    "costs sparse": lambda chance: _costly(chance, (15, 60), (1.5, 2.6)),
    "costs dense": lambda chance: _costly(chance, (8, 10), (6, 9)),
    "costs and conflicts": lambda chance: _costly(chance, (8, 20), (2, 5), tightness=0.4),
    "costs on trees": lambda chance: _tree(chance, 100),
    "costs on ladders": _ladder,
    "weighted colouring": lambda chance: _graph_colouring(chance, "small-world", "weighted", (8, 40)),
    "soft scale-free colouring": lambda chance: _graph_colouring(chance, "scale-free", "soft", (8, 60)),
    "ising": lambda chance: _family("ising", chance, rows=chance.randint(3, 4), columns=chance.randint(3, 12)),
    "meetings with preferences": lambda chance: _meetings(chance, "eav", required=False),
    "meetings by person with preferences": lambda chance: _meetings(chance, "peav", required=False),
    "tasks": lambda chance: _family("tasks", chance, agents=chance.randint(8, 12), tasks=chance.randint(3, 7)),
    "tracking": lambda chance: _family(
        "tracking", chance, agents=chance.randint(8, 16), targets=chance.randint(4, 8), side=9
    ),
}  # fmt: skip
"""For each family, the function that makes a problem from a random number generator."""
