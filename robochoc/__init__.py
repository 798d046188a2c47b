"""Teams of robots that solve constraint problems together.

Names:
    load: Reads a team's files, and returns a `Problem`.
    Problem: A problem; its method `solve()` solves it on this machine.
    Model: A problem written in Python, with operators.
    ArrayProblem: A problem with very many robots, built from NumPy arrays.
    all_different, allowed, forbidden, costs, function, element, cumulative, minimum, maximum, if_then_else, all_of,
        any_of: Constraints and costs of a model for which there is no operator.
    from_cpmpy: Distributes a CPMpy model over robots (the extra `cpmpy`).
    Outcome: The result of a run; `solve()` returns its subclass `Solution`.
    Verdict: The answer to a problem: solution, optimal, no solution, unknown.
    register: Registers a protocol of this program under a name.
    travel_times: Travel times of a robot between places on a map, around its walls.
    read_result: Reads a JSON result of `robochoc solve --json` as an `Outcome`.
    AgentsContainer: The master or robots on one machine of a network.
    journal: Journals of runs; `journal.rows(path)` returns rows for pandas or polars.
    RobochocError: The base class of all exceptions: InvalidInputError, ModelError, OptionError, UnsupportedError,
        UnknownProtocolError, CompileError, RobotsLostError, RefutedError and others.

Example:
    >>> import robochoc
    >>> robochoc.load("instances/queens3d-4").solve(runtime="simulator").verdict
    <Verdict.NO_SOLUTION: 'no-solution'>
"""

from __future__ import annotations

import os

TYPE_CHECKING = False  # to import `typing` would delay the handling of signals (cli/main.py)
if TYPE_CHECKING:
    from robochoc import journal
    from robochoc.api import AgentsContainer, Problem, load
    from robochoc.communication.search_result import RobotsLostError
    from robochoc.formats.diagnostics import InvalidInputError
    from robochoc.formats.result import read_result
    from robochoc.maps.reachability.travel import travel_times
    from robochoc.model.outcome import Outcome, Verdict
    from robochoc.modelling.array_problem import ArrayProblem
    from robochoc.modelling.cpmpy_models import from_cpmpy
    from robochoc.modelling.errors import ModelError
    from robochoc.modelling.functions import (
        all_different,
        allowed,
        costs,
        cumulative,
        element,
        forbidden,
        function,
        if_then_else,
        maximum,
        minimum,
    )
    from robochoc.modelling.model import Model
    from robochoc.modelling.solution import Solution
    from robochoc.modelling.terms import all_of, any_of
    from robochoc.run.registry import UnknownProtocolError, register
    from robochoc.solver.compile import CompileError
    from robochoc.solver.errors import UnsupportedError
    from robochoc.system.errors import OptionError, RobochocError
    from robochoc.verification.checker import RefutedError

__all__ = [
    "AgentsContainer",
    "ArrayProblem",
    "CompileError",
    "InvalidInputError",
    "Model",
    "ModelError",
    "OptionError",
    "Outcome",
    "Problem",
    "RefutedError",
    "RobochocError",
    "RobotsLostError",
    "Solution",
    "UnknownProtocolError",
    "UnsupportedError",
    "Verdict",
    "__version__",
    "all_different",
    "all_of",
    "allowed",
    "any_of",
    "costs",
    "cumulative",
    "element",
    "forbidden",
    "from_cpmpy",
    "function",
    "if_then_else",
    "journal",
    "load",
    "maximum",
    "minimum",
    "read_result",
    "register",
    "travel_times",
]

__version__ = "1.0.0"

if os.environ.get("ROBOCHOC_PURE", "0") not in {"", "0"}:  # before any other module of ours is imported
    from robochoc.system.compiled_core import prefer_sources

    prefer_sources()

_FUNCTIONS = "all_different allowed costs cumulative element forbidden function if_then_else maximum minimum"
_PLACES = {
    **dict.fromkeys(("AgentsContainer", "Problem", "load"), "robochoc.api"),
    **dict.fromkeys(("Outcome", "Verdict"), "robochoc.model.outcome"),
    **dict.fromkeys(_FUNCTIONS.split(), "robochoc.modelling.functions"),
    **dict.fromkeys(("all_of", "any_of"), "robochoc.modelling.terms"),
    "ArrayProblem": "robochoc.modelling.array_problem",
    "from_cpmpy": "robochoc.modelling.cpmpy_models",
    "Model": "robochoc.modelling.model",
    "ModelError": "robochoc.modelling.errors",
    "Solution": "robochoc.modelling.solution",
    "CompileError": "robochoc.solver.compile",
    "InvalidInputError": "robochoc.formats.diagnostics",
    "OptionError": "robochoc.system.errors",
    "read_result": "robochoc.formats.result",
    "register": "robochoc.run.registry",
    "RefutedError": "robochoc.verification.checker",
    "RobochocError": "robochoc.system.errors",
    "travel_times": "robochoc.maps.reachability.travel",
    "RobotsLostError": "robochoc.communication.search_result",
    "UnknownProtocolError": "robochoc.run.registry",
    "UnsupportedError": "robochoc.solver.errors",
}


def __getattr__(name: str) -> object:
    """Import a name on first use, so that the command line starts quickly."""
    import importlib  # noqa: PLC0415 - start-up

    if name in _PLACES:
        return getattr(importlib.import_module(_PLACES[name]), name)
    if name == "journal":
        return importlib.import_module("robochoc.journal")
    import difflib  # noqa: PLC0415 - only mistakes need it

    near = difflib.get_close_matches(name, __all__, 1)
    hint = f"; did you mean {near[0]!r}?" if near and not name.startswith("_") else ""
    raise AttributeError(f"module 'robochoc' has no attribute {name!r}{hint}")


def __dir__() -> list[str]:
    """Return the public names."""
    return list(__all__)
