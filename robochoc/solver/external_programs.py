"""The external solvers of networks: CP-SAT of OR-Tools, toulbar2, cosoco and ACE, each with its package and limits."""

from __future__ import annotations

import importlib.util
import math
import signal
from collections.abc import Callable
from typing import NamedTuple

from robochoc.solver.encoding import Costs, Network
from robochoc.solver.linear import Formula, Junction

MAX_ARRAY = 4_000_000
"""The maximum number of costs in an array for toulbar2."""
MAX_COSOCO_COST = 2**30
"""The maximum cost of a solution for cosoco, which computes costs in 32 bits."""


class ExternalProgram(NamedTuple):
    """An external solver.

    Attributes:
        name: Its name in messages.
        extra: The extra of robochoc that installs it; also the value of `--with`. Empty for ACE.
        package: Its Python package.
        module: The module that runs as its process.
        refusal: Returns the reason why it cannot solve a network with costs (None: it can).
        interrupt: A signal after which its process returns the best solution found (None: it observes the deadline).
        ends_group: True if the programs that its process has started must be ended, too.
        is_single_use: True if its process solves one network only, because global state would remain.
    """

    name: str
    extra: str
    package: str
    module: str
    refusal: Callable[[Network, Costs], str | None]
    interrupt: int | None = None
    ends_group: bool = True
    is_single_use: bool = False

    @property
    def install(self) -> str:
        """Return the command that installs it. ACE comes with robochoc."""
        if not self.extra:
            return "pip install --force-reinstall robochoc"
        return f"pip install 'robochoc[{self.extra}]'"

    def is_installed(self) -> bool:
        """Return whether its package is installed, without importing it."""
        return importlib.util.find_spec(self.package) is not None


def _no_refusal(network: Network, costs: Costs) -> str | None:  # noqa: ARG001 - these support all networks
    return None


def _refusal_of_toulbar2(network: Network, costs: Costs) -> str | None:
    if not all(map(_is_conjunction, network.formulas)):
        return "toulbar2 does not support disjunctions of sums"
    paid = {place for place, _ in costs}
    sizes = [len(domain) for domain in network.domains]
    for table in network.tables:
        scope = [place for place in table.scope if not (place in paid and table.allowed)]
        size = math.prod(sizes[place] for place in scope)
        if len(scope) <= 3 and size > MAX_ARRAY:  # noqa: PLR2004 - toulbar2 stores these as arrays
            return f"a constraint has {size:,} combinations of values, and toulbar2 stores at most {MAX_ARRAY:,}"
    return None


def _is_conjunction(formula: Formula) -> bool:
    if isinstance(formula, Junction):
        return formula.every and all(map(_is_conjunction, formula.parts))
    return formula.sign != "ne"


def _refusal_of_cosoco(network: Network, costs: Costs) -> str | None:
    most = sum(unit * max(network.domains[place], default=0) for place, unit in costs)
    if most > MAX_COSOCO_COST:
        return f"costs may add up to {most:,} units, and cosoco supports at most {MAX_COSOCO_COST:,}"
    return None


CP_SAT = ExternalProgram("OR-Tools", "ortools", "ortools", "robochoc.solver.cp_sat_process", _no_refusal)
TOULBAR2 = ExternalProgram(
    "toulbar2",
    "toulbar2",
    "pytoulbar2",
    "robochoc.solver.toulbar2_process",
    _refusal_of_toulbar2,
    getattr(signal, "SIGVTALRM", None),
    is_single_use=True,
)
COSOCO = ExternalProgram("cosoco", "cosoco", "cosoco_bin", "robochoc.solver.cosoco_process", _refusal_of_cosoco)
ACE_NETWORK = ExternalProgram("ACE", "", "pycsp3", "robochoc.solver.ace_network_process", _no_refusal, ends_group=False)
PROGRAMS = {program.extra: program for program in (CP_SAT, TOULBAR2, COSOCO)}
