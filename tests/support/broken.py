"""Broken teams as data: what is wrong, how it comes about, and the one message that says so.

Every case starts from `broken_case.TEAM`, three robots without a fault. `test_bad_input.py` reads them, and whoever
tests a command can as well: `case.write(folder)`, give it `folder / case.target`, expect `case.expected(folder)`.
"""

from __future__ import annotations

from tests.support.broken_case import Broken
from tests.support.broken_costs import COSTS
from tests.support.broken_files import FILES, SCHEMA, WELL_FORMED
from tests.support.broken_robots import CONSTRAINTS, DEFINITIONS, DOMAINS
from tests.support.broken_scenarios import CHANGES
from tests.support.broken_teams import MANY, NEIGHBOURS, SCENARIOS

CASES: list[Broken] = [
    *FILES,
    *WELL_FORMED,
    *SCHEMA,
    *DOMAINS,
    *DEFINITIONS,
    *CONSTRAINTS,
    *COSTS,
    *NEIGHBOURS,
    *SCENARIOS,
    *CHANGES,
    *MANY,
]
