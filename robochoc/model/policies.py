"""The values of a policy, and its costs in the scenarios (docs/guides/uncertainty.md)."""

from __future__ import annotations

from enum import StrEnum

from robochoc.model.cost_units import Cost
from robochoc.system.lazy_dataclass import dataclass


class Risk(StrEnum):
    """The minimised cost of a problem with random variables: its expectation, or its maximum over all scenarios."""

    EXPECTED = "expected"
    WORST = "worst"


@dataclass(frozen=True)
class Choice:
    """The value that a policy chooses after an observation.

    Attributes:
        when: The observed outcomes of random variables.
        value: The chosen value: an integer, a real number or a symbol.
    """

    when: dict[str, int]
    value: float | str


@dataclass(frozen=True)
class PolicyReport:
    """An answer to a problem with random variables. Costs are in the user's units.

    Attributes:
        risk: The cost that was optimised.
        expected: The expected cost, or utility. None: robots have withdrawn.
        worst: The cost in the worst scenario. None: robots have withdrawn, or there are too many scenarios.
        worst_scenario: The outcomes in a worst scenario; random variables that have no effect on costs are left out.
        scenarios: The number of joint outcomes of all random variables.
        policies: The choices of each variable whose value is chosen after an observation.
    """

    risk: Risk
    expected: Cost | None
    worst: Cost | None
    worst_scenario: dict[str, int]
    scenarios: int
    policies: dict[str, tuple[Choice, ...]]
