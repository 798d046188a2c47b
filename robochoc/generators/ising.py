"""Ising models: spins on a torus, each with its own field and coupled to its four neighbours.

Ising models are a benchmark for belief propagation on graphs with many cycles (Cerquides, Emonet, Picard and
Rodriguez-Aguilar, "Improving Max-Sum through decimation to solve cyclic distributed constraint optimization problems",
2018, arXiv 1706.02209); pyDCOP generates them as well. Each spin is 0 or 1. With a field k, drawn from [-rho, rho], the
spin 0 costs k and the spin 1 costs -k. With a coupling k, drawn from [-beta, beta], equal spins cost k and different
spins cost -k. The sum, which may be negative, is minimised.

Couplings and fields are decimals: with p places, all multiples of 10**-p in the range are equally likely.
"""

from __future__ import annotations

from robochoc.generators.draws import MAX_COST, MAX_NODES, check_bounds, check_places, in_units, random_integer, seeded
from robochoc.generators.graphs import grid_edges
from robochoc.model.assembly import assemble
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import Constraint, Domain, ProblemKind, Relation, Semantics, Team, Variable

SPINS = Domain("Spin", (range(2),))


def ising(
    rows: int, columns: int, seed: int = 0, *, coupling: float = 1.6, field: float = 0.05, places: int = 3
) -> Team:
    """Return a random Ising model with rows x columns spins.

    `Robot2.3`, in row 2 and column 3, owns `V2.3`.

    Args:
        rows: The number of rows.
        columns: The number of columns.
        seed: The same seed gives the same problem on every machine.
        coupling: The strength of couplings, beta.
        field: The strength of fields, rho.
        places: The decimal places of couplings and fields.

    Raises:
        ValueError: A number is out of bounds.
    """
    check_bounds({"rows": (rows, 2, MAX_NODES), "columns": (columns, 2, MAX_NODES)})
    check_bounds({"rows x columns": (rows * columns, 4, MAX_NODES)})
    check_bounds({"coupling": (coupling, 0, MAX_COST), "field": (field, 0, MAX_COST)})
    check_places(places)
    beta, rho = in_units(coupling, places), in_units(field, places)
    chance = seeded(seed)
    cells = [f"{row}.{column}" for row in range(1, rows + 1) for column in range(1, columns + 1)]
    constraints = []
    for cell in cells:
        strength = random_integer(chance, -rho, rho)
        relation = Relation(f"U{cell}", 1, Semantics.SOFT, ((0,), (1,)), (strength, -strength))
        constraints.append(Constraint(f"U{cell}", relation, (f"V{cell}",), (f"V{cell}",)))
    for one, other in grid_edges(rows, columns, torus=True):
        strength = random_integer(chance, -beta, beta)
        name = f"C{cells[one - 1]}.{cells[other - 1]}"
        pairs = ((0, 0), (0, 1), (1, 0), (1, 1))
        relation = Relation(name, 2, Semantics.SOFT, pairs, (strength, -strength, -strength, strength))
        scope = (f"V{cells[one - 1]}", f"V{cells[other - 1]}")
        constraints.append(Constraint(name, relation, scope, scope))
    label = f"{float(coupling)}-{float(field)}" + (f"-{places}" if places != 3 else "")  # noqa: PLR2004 - the default
    return assemble(
        f"ising-{rows}x{columns}-{label}-{seed}",
        {f"Robot{cell}": [Variable(f"V{cell}", SPINS)] for cell in cells},
        constraints,
        kind=ProblemKind.DISWCSP,
        costs=CostUnits(places=places),
    )
