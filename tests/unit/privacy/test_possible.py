"""What statements rule out, held against all that may be."""

from __future__ import annotations

import itertools
from random import Random

from robochoc.model.problem import INFINITE
from robochoc.privacy.possible import (
    ANY,
    AtLeast,
    AtMost,
    CostCase,
    Knowledge,
    OneAtMost,
    OneCase,
    PossibleCosts,
    Statement,
)

MOST = 2
COSTS = (0, 1, 2, INFINITE)


def true_of(statement: Statement, costs: tuple[float, ...]) -> bool:
    """Whether a statement is true if secret i costs `costs[i]`."""
    match statement:
        case AtLeast(terms, least):
            return sum(costs[one] for one in terms) >= least
        case AtMost(terms, most):
            return sum(costs[one] for one in terms) <= most
        case OneAtMost(sums, most):
            return any(sum(costs[one] for one in terms) <= most for terms in sums)
        case OneCase(cases):
            return any(
                all(costs[one] < INFINITE for one in case.finite)
                and all(any(costs[one] == INFINITE for one in terms) for terms in case.broken)
                for case in cases
            )


def random_statement(chance: Random, costs: tuple[float, ...]) -> Statement:
    """A random statement that is true of `costs`."""

    def terms() -> tuple[int, ...]:
        return tuple(chance.sample(range(len(costs)), chance.randint(0, len(costs))))

    while True:
        drawn: list[Statement] = [
            AtLeast(terms(), chance.choice([1, 2, 3, INFINITE])),
            AtMost(terms(), chance.randint(0, 4)),
            OneAtMost((terms(), terms()), chance.randint(0, 3)),
            OneCase((CostCase(terms(), (terms(),)), CostCase(terms(), ()))),
        ]
        statement = chance.choice(drawn)
        if true_of(statement, costs):
            return statement


def test_what_may_be_is_never_ruled_out_and_something_is() -> None:
    chance = Random(1)
    narrowed = 0
    for _ in range(400):
        truth = tuple(chance.choices(COSTS, k=3))
        statements = [random_statement(chance, truth) for _ in range(chance.randint(1, 5))]
        knowledge = Knowledge(MOST)
        for statement in statements:
            knowledge.add_statement(statement)
        knowledge.settle()
        worlds = [w for w in itertools.product(COSTS, repeat=3) if all(true_of(one, w) for one in statements)]
        for world in worlds:
            assert all(knowledge[secret].contains(cost) for secret, cost in enumerate(world)), statements
        narrowed += sum(knowledge[secret].number < len(COSTS) for secret in range(3))
    assert narrowed > 200


def test_a_single_unbounded_term_makes_up_for_the_others() -> None:
    knowledge = Knowledge(5)
    knowledge.add_statement(AtMost((1,), 2))
    knowledge.add_statement(AtLeast((0, 1), 6))
    knowledge.settle()
    assert knowledge[0] == PossibleCosts(4, 5, infinite=True)


def test_of_a_free_secret_nothing_is_concluded() -> None:
    knowledge = Knowledge(5, free={0})
    knowledge.add_statement(AtLeast((0,), INFINITE))
    knowledge.add_statement(AtMost((0,), 1))
    knowledge.settle()
    assert knowledge[0] == ANY


def test_equal_numbers_of_two_kinds_of_statements_are_two_statements() -> None:
    knowledge = Knowledge(5)
    knowledge.add_statement(AtLeast((0,), 3))
    knowledge.add_statement(AtMost((0,), 3))
    knowledge.settle()
    assert knowledge[0] == PossibleCosts(3, 3, infinite=False)
