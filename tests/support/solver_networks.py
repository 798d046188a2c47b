"""Networks of the constraint solver, and all their solutions by brute force."""

from __future__ import annotations

import itertools
from random import Random

import pytest

from robochoc.model.problem import Team
from robochoc.solver.ace import AceProcess
from robochoc.solver.ace_messages import FromAce
from robochoc.solver.compiled_domain import compile_domain
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.encoding import Codes, CodeTable, Network

SMALL_NETWORK = Network(((0, 1), (0, 1)), (CodeTable((0, 1), allowed=False, rows=((0, 0),)),))


def queens_network(n: int) -> Network:
    """The n queens of a chessboard, by binary tables alone."""
    rows = range(n)
    tables = []
    for one, other in itertools.combinations(rows, 2):
        apart = [(a, b) for a, b in itertools.product(rows, rows) if a != b and abs(a - b) != other - one]
        tables.append(CodeTable((one, other), allowed=True, rows=tuple(apart)))
    return Network((tuple(rows),) * n, tuple(tables))


def brute_force(network: Network) -> list[Codes]:
    """Return all solutions of `network`, by trying everything."""
    return [
        codes
        for codes in itertools.product(*network.domains)
        if all((tuple(codes[p] for p in table.scope) in table.rows) is table.allowed for table in network.tables)
        and all(len({codes[p] for p in scope}) == len(scope) for scope in network.different)
    ]


def random_network(chance: Random) -> Network:
    """Up to five variables; domains of one value, tables of either kind, and rows that no domain has."""
    size = chance.randint(1, 5)
    domains = tuple(tuple(sorted(chance.sample(range(6), chance.choice((1, 2, 3, 3, 4))))) for _ in range(size))
    tables = []
    for _ in range(chance.randint(0, 5)):
        scope = tuple(sorted(chance.sample(range(size), min(size, chance.choice((1, 2, 2, 2, 3))))))
        allowed = chance.random() < 0.4
        likely = chance.uniform(0.4, 0.9) if allowed else chance.uniform(0.05, 0.4)
        rows = {row for row in itertools.product(*(domains[p] for p in scope)) if chance.random() < likely}
        rows |= {tuple(chance.randrange(9) for _ in scope)} if chance.random() < 0.3 else set()
        tables.append(CodeTable(scope, allowed, tuple(sorted(rows))))
    different = [tuple(sorted(chance.sample(range(size), chance.randint(2, size))))] if size > 1 else []
    return Network(domains, tuple(tables), tuple(different) if chance.random() < 0.4 else ())


SMALL_SOLUTIONS: tuple[Codes, ...] = ((0, 1), (1, 0), (1, 1))


def misheard(patch: pytest.MonkeyPatch, word: FromAce) -> None:
    """Whatever ACE answers, `word` is what is heard."""
    hear = vars(AceProcess)["_receive_message"]

    def hear_another(solver: AceProcess, deadline: float | None) -> FromAce:
        hear(solver, deadline)
        return word

    patch.setattr(AceProcess, "_receive_message", hear_another)


def compiled_by_brute_force(team: Team) -> CompiledTeam:
    """Return `team`, its local problems solved by brute force."""
    return CompiledTeam(team, lambda robot: compile_domain(robot, brute_force))
