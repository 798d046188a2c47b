"""PropFlow (MIT): belief propagation on factor graphs, by its engines. `scripts/propflow_once.py` calls them.

Source: PropFlow's documentation of its engines. Forbidden tuples get the cost that they have in files for pyDCOP.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from types import MappingProxyType
from typing import ClassVar

import msgspec

from robochoc.formats.dialects.tabulation import constant_table, forbidden_cost, is_maximised, tabulate
from robochoc.leaderboard.peers.peer import CYCLES, SCRIPTS, Algorithm, Peer, PeerAnswer, PeerError, last_line, violates
from robochoc.leaderboard.peers.program import EndedProgram
from robochoc.model.constraint import INFINITE
from robochoc.model.problem import Team
from robochoc.system.plain_text import on_one_line

SCRIPT = SCRIPTS / "propflow_once.py"
_PROBLEM = "problem.json"


class _Problem(msgspec.Struct):
    """The file of a problem: domains, and for each constraint its variables and the costs of all tuples in order."""

    domains: dict[str, list[int]]
    constraints: list[tuple[tuple[str, ...], list[float]]]
    maximises: bool
    forbidden: float


class _Result(msgspec.Struct):
    """The last line that the script prints; values are places in domains."""

    assignment: dict[str, int]
    cost: float


class Propflow(Peer):
    """PropFlow."""

    name = "propflow"
    title = "PropFlow"
    place_name = "PYTHON"
    install = "install it in a virtual environment, pip install propflow, and give its bin/python"
    algorithms: ClassVar[Mapping[str, Algorithm]] = MappingProxyType(
        {
            "maxsum": Algorithm(("BPEngine",)),
            "maxsum-damped": Algorithm(("DampingEngine",)),
            "maxsum-split": Algorithm(("SplitEngine",)),
            "maxsum-damped-split": Algorithm(("DampingSCFGEngine",)),
            "maxsum-trw": Algorithm(("TRWEngine",)),
            "maxsum-diffusion": Algorithm(("DiffusionEngine",)),
        }
    )

    def version(self) -> str:
        """Return the version of the package."""
        return f"{self.title} {self._reported(str(self.place), '-I', str(SCRIPT), '--version')}"

    def command(self, team: Team, algorithm: Algorithm, folder: Path, time_s: float) -> list[str]:
        """Write the tables of all constraints."""
        del time_s  # it has no time limit of its own
        tables, constant = tabulate(team)
        forbidden = forbidden_cost(tables, constant)
        if constant:
            tables.append(constant_table(team, constant))
        maximises = is_maximised(team)
        sign = -1 if maximises else 1
        domains = {name: list(variable.domain) for name, variable in team.variables.items()}
        constraints = []
        for one in tables:
            rows, other = one.table.rows, one.table.default
            costs = [rows.get(values, other) for values in itertools.product(*(domains[name] for name in one.scope))]
            signed = [float(forbidden if cost == INFINITE else sign * Fraction(cost)) for cost in costs]
            constraints.append((one.scope, signed))
        problem = _Problem(domains, constraints, maximises, forbidden)
        (folder / _PROBLEM).write_bytes(msgspec.json.encode(problem))
        return [str(self.place), "-I", str(SCRIPT), "--engine", *algorithm.words, str(CYCLES), _PROBLEM]

    def answer(self, folder: Path, ended: EndedProgram) -> PeerAnswer:
        """Return the answer in the last line of the output. PropFlow counts nothing."""
        lines = ended.output.splitlines()
        if ended.status != 0 or not lines:
            raise PeerError(last_line(ended) or f"ended with status {ended.status}")
        problem = msgspec.json.decode((folder / _PROBLEM).read_bytes(), type=_Problem)
        try:
            found = msgspec.json.decode(lines[-1], type=_Result)
            values = {name: problem.domains[name][place] for name, place in found.assignment.items()}
        except (msgspec.MsgspecError, LookupError, RecursionError) as wrong:
            raise PeerError(f"its result cannot be read: {on_one_line(str(wrong), 200)}") from None
        cost = math.inf if violates(found.cost, problem.forbidden) else -found.cost if problem.maximises else found.cost
        return PeerAnswer(values, cost, is_finished=True)
