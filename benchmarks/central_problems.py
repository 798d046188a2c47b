"""The problems of the part `central`: 100 instances of 20 families, each determined by its family and its number."""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from random import Random

from choice_problems import PROBLEMS

from robochoc.formats.dialects.dialect import ImportOptions
from robochoc.formats.dialects.registry import read_foreign
from robochoc.generators.coloring import coloring
from robochoc.generators.families import FAMILIES as GENERATORS
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.model.assembly import assemble
from robochoc.model.problem import Constraint, Domain, ProblemKind, Relation, Semantics, Team, Variable

FAMILIES: Mapping[str, tuple[int, Callable[[int], Team]]] = {
    "meetings": (4, lambda seed: _meetings(40 + 20 * seed, "eav", seed, required=True)),
    "meetings by person": (4, lambda seed: _meetings(30 + 10 * seed, "peav", seed, required=True)),
    "meetings with preferences": (6, lambda seed: _meetings(12 + 3 * seed, "eav", seed, required=False)),
    "meetings by person with preferences": (4, lambda seed: _meetings(8 + 2 * seed, "peav", seed, required=False)),
    "3D queens, n = 6 to 12": (7, lambda seed: queens3d(6 + seed)),
    "3D queens, full model, n = 6 to 8": (3, lambda seed: queens3d(6 + seed, "full")),
    "3-colouring": (6, lambda seed: coloring(200, 3, 4.3 + 0.1 * seed, seed, conflicts="hard")),
    "5-colouring": (4, lambda seed: coloring(120, 5, 10.0 + 0.5 * seed, seed, conflicts="hard")),
    "weighted colouring": (6, lambda seed: coloring(24 + 6 * seed, 3, 4.0 + seed % 3, seed, conflicts="weighted")),
    "frequency assignment": (6, lambda seed: frequencies(Random(seed), 40 + 5 * seed, soft=False)),
    "frequency assignment, soft": (6, lambda seed: frequencies(Random(seed), 30 + 10 * seed, soft=True)),
    "random CSP, hard": (8, lambda seed: _at_the_transition(24 + 2 * seed, seed)),
    "random CSP, large": (4, lambda seed: random_csp(150 * (1 + seed), 5, 5 / (150 * (1 + seed)), 0.36, seed)),
    "random WCSP": (8, lambda seed: random_csp(12 + 2 * seed, 6, 0.35, 0.0, seed, max_cost=100)),
    "random WCSP with conflicts": (7, lambda seed: random_csp(15 + 3 * seed, 6, 0.3, 0.3, seed, max_cost=100)),
    "Ising": (3, lambda seed: GENERATORS["ising"](rows=4, columns=4 * (1 + seed), seed=seed)),
    "tasks": (4, lambda seed: PROBLEMS["tasks"](Random(seed))),
    "tracking": (2, lambda seed: PROBLEMS["tracking"](Random(1 + seed))),
    "XCSP3, satisfaction": (4, lambda seed: imported(magic_square(4) if not seed else golomb(5 + seed, 34))),
    "XCSP3, optimisation": (4, lambda seed: imported(job_shop(Random(seed), 3 + seed // 2, 3))),
}  # fmt: skip
"""For each family, the number of its instances and the function that builds one."""


def instances() -> Iterator[tuple[str, int]]:
    """Yield the family and the number of each instance."""
    for family, (number, _) in FAMILIES.items():
        yield from ((family, seed) for seed in range(number))


def problem(family: str, seed: int) -> Team:
    """Return an instance."""
    return FAMILIES[family][1](seed)


def _meetings(persons: int, model: str, seed: int, *, required: bool) -> Team:
    some = {"agents": persons, "meetings": persons, "slots": 6 if required else 5, "participants": 3, "model": model}
    return GENERATORS["meetings"](**some, required=required, seed=seed)


def _at_the_transition(agents: int, seed: int) -> Team:
    """Return a random problem with about one solution: half of such problems have none."""
    tightness = 1 - 8 ** (-2 / (0.35 * (agents - 1)))
    return random_csp(agents, 8, 0.35, tightness, seed)


def frequencies(chance: Random, links: int, *, soft: bool) -> Team:
    """Return links in a square, whose frequencies must be, or (`soft`) should be, apart if the links are close."""
    places = [(chance.random(), chance.random()) for _ in range(links)]
    values = Domain("Frequencies", (range(1, 13),))
    variables = {f"Link{number}": [Variable(f"F{number}", values)] for number in range(links)}
    relations = {apart: _apart(apart, 0 if not soft else 1) for apart in (1, 2, 3)}
    constraints = []
    for one, other in itertools.combinations(range(links), 2):
        distance = ((places[one][0] - places[other][0]) ** 2 + (places[one][1] - places[other][1]) ** 2) ** 0.5
        apart = 3 - int(distance / (0.12 if soft else 0.1))
        if apart > 0:
            scope = (f"F{one}", f"F{other}")
            constraints.append(Constraint(f"C{one}.{other}", relations[apart], scope, scope))
    kind = ProblemKind.DISWCSP if soft else ProblemKind.DISCSP
    return assemble(f"frequencies-{links}", variables, constraints, kind=kind)


def _apart(apart: int, cost: int) -> Relation:
    near = [(a, b) for a in range(1, 13) for b in range(1, 13) if abs(a - b) < apart]
    if not cost:
        return Relation(f"Apart{apart}", 2, Semantics.CONFLICTS, tuple(near))
    prices = tuple(10 * (apart - abs(a - b)) ** 2 for a, b in near)
    return Relation(f"Apart{apart}", 2, Semantics.SOFT, tuple(near), prices, 0)


def imported(document: str) -> Team:
    """Return the problem in an XCSP3 document."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "problem.xml"
        path.write_text(document, encoding="utf-8")
        return read_foreign([path], ImportOptions()).team


def magic_square(n: int) -> str:
    """Return an XCSP3 document: the numbers 1 to n² in a square whose rows, columns and diagonals have equal sums."""
    cells = [[f"x{row * n + column}" for column in range(n)] for row in range(n)]
    lines = [*cells, *map(list, zip(*cells, strict=True))]
    lines += [[cells[i][i] for i in range(n)], [cells[i][n - 1 - i] for i in range(n)]]
    total = n * (n * n + 1) // 2
    variables = "".join(f'<var id="x{number}"> 1..{n * n} </var>' for number in range(n * n))
    sums = "".join(f"<sum><list> {' '.join(line)} </list><condition> (eq,{total}) </condition></sum>" for line in lines)
    different = f"<allDifferent> {' '.join(itertools.chain(*cells))} </allDifferent>"
    return _document("CSP", variables, different + sums)


def golomb(marks: int, length: int) -> str:
    """Return an XCSP3 document: marks on a ruler whose distances are all different."""
    variables = "".join(f'<var id="m{number}"> 0..{length} </var>' for number in range(marks))
    rules = [f"lt(m{number},m{number + 1})" for number in range(marks - 1)]
    pairs = list(itertools.combinations(range(marks), 2))
    variables += "".join(f'<var id="d{a}_{b}"> 1..{length} </var>' for a, b in pairs)
    rules += [f"eq(m{b},add(m{a},d{a}_{b}))" for a, b in pairs]
    different = f"<allDifferent> {' '.join(f'd{a}_{b}' for a, b in pairs)} </allDifferent>"
    return _document("CSP", variables, different + "".join(f"<intension> {rule} </intension>" for rule in rules))


def job_shop(chance: Random, jobs: int, machines: int) -> str:
    """Return an XCSP3 document: the tasks of each job in order, one task at a time on each machine; end early."""
    horizon = 12 * max(jobs, machines)
    variables, rules, on = f'<var id="end"> 0..{horizon} </var>', list[str](), dict[int, list[tuple[str, int]]]()
    for job in range(jobs):
        before: tuple[str, int] | None = None
        for place, machine in enumerate(chance.sample(range(machines), machines)):
            task = f"t{job}_{place}", chance.randint(1, 9)
            variables += f'<var id="{task[0]}"> 0..{horizon} </var>'
            rules += [f"le(add({before[0]},{before[1]}),{task[0]})"] if before else []
            on.setdefault(machine, []).append(task)
            before = task
        rules += [f"le(add({before[0]},{before[1]}),end)"] if before else []
    for tasks in on.values():
        for (a, long), (b, other) in itertools.combinations(tasks, 2):
            rules.append(f"or(le(add({a},{long}),{b}),le(add({b},{other}),{a}))")
    constraints = "".join(f"<intension> {rule} </intension>" for rule in rules)
    return _document("COP", variables, constraints, "<objectives><minimize> end </minimize></objectives>")


def _document(kind: str, variables: str, constraints: str, objectives: str = "") -> str:
    body = f"<variables>{variables}</variables><constraints>{constraints}</constraints>{objectives}"
    return f'<instance format="XCSP3" type="{kind}">{body}</instance>'
