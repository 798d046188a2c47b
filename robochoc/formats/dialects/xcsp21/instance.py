"""An instance of XCSP 2.1 with agents, as data: with the names of its file, and exact costs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import NoReturn

from robochoc.formats.diagnostics import Diagnostic, InvalidInputError, encodable
from robochoc.formats.dialects.dialect import ConversionNote
from robochoc.model.constraint import Function, Predicate
from robochoc.system.lazy_dataclass import dataclass

UNIT = "unit of costs"
"""The name of the `stats` element of the presentation that states the value of a cost of 1, such as 0.01."""

Price = Decimal | float
"""A cost: exact, or `INFINITE` for a forbidden tuple."""


@dataclass(frozen=True)
class ForeignTable:
    """A relation: the costs of the listed tuples, and the cost of all others."""

    name: str
    arity: int
    costs: Mapping[tuple[int, ...], Price]
    default: Price


@dataclass(frozen=True)
class AsymmetricTable:
    """A relation with two costs a tuple: one for the agent of each variable (ADCOP)."""

    first: ForeignTable
    second: ForeignTable


@dataclass(frozen=True)
class Formula:
    """A predicate or function applied to terms: variables by their names in the file, and integers.

    Attributes:
        definition: The predicate or function.
        terms: Its actual parameters.
        cost: The cost of violating a predicate. None: the predicate is hard.
    """

    definition: Predicate | Function
    terms: tuple[str | int, ...]
    cost: Decimal | None = None


@dataclass(frozen=True)
class ForeignVariable:
    """A variable: its domain, and its owner, if it has one."""

    name: str
    domain: str
    ranges: tuple[range, ...]
    owner: str
    line: int


@dataclass(frozen=True)
class ForeignConstraint:
    """A constraint; `private_agent` is the only agent that knows it, or empty if all agents of its scope do."""

    name: str
    scope: tuple[str, ...]
    content: ForeignTable | AsymmetricTable | Formula
    private_agent: str
    file: str
    line: int


@dataclass
class Instance:
    """The contents of a file, or of all files of a problem.

    Attributes:
        file: The path of the file.
        name: The name of the problem.
        maximize: True if the costs are utilities.
        agents: The agents, the highest first.
        self_agent: The agent whose file this is, if each agent has its own file.
        variables: The variables, by their names.
        random: The random variables, by their names. They have no owner.
        laws: The probabilities of the random variables.
        constraints: The constraints.
        constant: The constant added to the cost.
        maximal_cost: Costs of at least this are infinite. None: no finite cost is.
        ids: The agents by their `id`.
        type: The kind of problem that the file states.
        constraint_model: The constraint model of constraints without the attribute `model`: TKC or PKC.
        notes: The differences from the file.
    """

    file: Path
    name: str = ""
    maximize: bool = False
    agents: list[str] = field(default_factory=list)
    self_agent: str = ""
    variables: dict[str, ForeignVariable] = field(default_factory=dict)
    random: dict[str, ForeignVariable] = field(default_factory=dict)
    laws: dict[str, Mapping[int, Fraction]] = field(default_factory=dict)
    constraints: list[ForeignConstraint] = field(default_factory=list)
    constant: Decimal = Decimal(0)
    maximal_cost: Decimal | None = None
    ids: dict[str, str] = field(default_factory=dict)
    type: str = ""
    constraint_model: str = ""
    notes: list[ConversionNote] = field(default_factory=list)


def refuse(file: Path | str, line: int, message: str, hint: str) -> NoReturn:
    """Raise `InvalidInputError` with one message."""
    raise InvalidInputError([Diagnostic(encodable(str(file)), line, message, hint)])
