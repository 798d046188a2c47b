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
class SampledCost:
    """The cost of a policy that is the best for samples, and an interval for its expected cost.

    Attributes:
        samples: The number of samples with which the search replaced expectations.
        cost: The average cost for these samples, which was optimised.
        fresh: The number of further samples, independent of the search, on which the interval is based. 0: there is no
            interval, since the expected cost is known exactly, or its range is not.
        low: The lower end of the 95 % confidence interval of the expected cost.
        high: Its upper end.
        method: The inequality from which the interval follows: `empirical Bernstein`.
    """

    samples: int
    cost: Cost
    fresh: int = 0
    low: Cost | None = None
    high: Cost | None = None
    method: str | None = None


@dataclass(frozen=True)
class PolicyReport:
    """An answer to a problem with random variables. Costs are in the user's units.

    Attributes:
        risk: The cost that was optimised.
        expected: The expected cost, or utility. None: robots have withdrawn, or there are too many outcomes.
        worst: The cost in the worst scenario. None: robots have withdrawn, or there are too many scenarios.
        worst_scenario: The outcomes in a worst scenario; random variables that have no effect on costs are left out.
        scenarios: The number of joint outcomes of all random variables.
        policies: The choices of each variable whose value is chosen after an observation.
        sampled: The cost for samples, if they replaced expectations.
    """

    risk: Risk
    expected: Cost | None
    worst: Cost | None
    worst_scenario: dict[str, int]
    scenarios: int
    policies: dict[str, tuple[Choice, ...]]
    sampled: SampledCost | None = None
