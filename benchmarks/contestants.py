"""Commands that solve the problems of part `peers`: robochoc's, and of each other library that is installed."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from measure import ROBOCHOC
from peer_problems import COLOURING, COSTS, FILES, LOCAL, RAVEN, TABLES, TEAM, Family
from peer_runs import Run

from robochoc.leaderboard.peers.frodo import described
from robochoc.leaderboard.peers.peer import SCRIPTS

PYTHON_OF_RAVEN = "ROBOCHOC_BENCH_RAVEN"
PYTHON_OF_PYDCOP = "ROBOCHOC_BENCH_PYDCOP"
FRODO = "ROBOCHOC_BENCH_FRODO"
PYTHON_OF_PROPFLOW = "ROBOCHOC_BENCH_PROPFLOW"
PYTHON_OF_CENTRAL = "ROBOCHOC_BENCH_CENTRAL"
HERE = Path(__file__).parent
CYCLES = 200
FORBIDDEN = 10_000
"""The least cost that a broken hard constraint has in files that we export for pyDCOP."""


class Answer(NamedTuple):
    """The answer of a run (`solution`, `no-solution`, a cost, or the error), and its number of messages, if counted."""

    found: str
    messages: int | None = None


@dataclass(frozen=True)
class Contestant:
    """One algorithm of one library, run in one way.

    `command` is made of a problem's folder; `answer` reads what a run printed or left there. `missing` says why it
    cannot be run here.
    """

    library: str
    algorithm: str
    way: str
    command: Callable[[Path], list[str]]
    answer: Callable[[Path, Run], Answer]
    missing: str = ""

    @property
    def name(self) -> str:
        """In one line."""
        return f"{self.library}, {self.algorithm}, {self.way}"


def contestants(family: Family) -> list[Contestant]:
    """All that are to solve a family, those that are missing here among them."""
    return [
        *_ours(family),
        *_frodos(family),
        *_pydcops(family),
        *_ravens(family),
        *_propflows(family),
        *_centrals(family),
        DCOPSOLVER,
    ]


# robochoc


def _ours(family: Family) -> list[Contestant]:
    if family is LOCAL:
        cycles = ("--set", f"cycles={CYCLES}")
        names = ("dsa", "mgm", "maxsum", "gdba", "mixed-dsa", "a-dsa", "maxsum-ad")
        ours = [*(robochoc(name, "simulator", *cycles) for name in names), robochoc("cocoa", "simulator")]
        return [*ours, *(robochoc(name, "arrays", *cycles) for name in ("dsa", "mgm", "maxsum"))]
    if family is COSTS:
        searches = ("syncbb", "adopt", "afb", "bnb-adopt", "ncbb", "pt-fb", "hs-cai", "sfb", "auto")
        tables = ("dpop", "mb-dpop", "rmb-dpop", "o-dpop", "p-dpop")
        return [robochoc(name, "simulator") for name in (*tables, *searches)]
    orders: tuple[tuple[str, ...], ...] = ((), ("--order", "max-degree"))
    paper = [
        robochoc(name, runtime, *order)
        for order in orders
        for name in ("abt", "afc-ng")
        for runtime in ("simulator", "processes")
    ]
    others = [robochoc(name, runtime) for name in ("sfb", "auto") for runtime in ("simulator", "processes")]
    return [*paper, *others]


def robochoc(protocol: str, runtime: str, *options: str) -> Contestant:
    """`robochoc solve`, as a user runs it."""
    words = ["--json", "--runtime", runtime, "--protocol", protocol, *options]
    order = f", {options[1]}" if "--order" in options else ", given order" if protocol in {"abt", "afc-ng"} else ""
    return Contestant(
        "robochoc", protocol, f"{runtime}{order}", lambda folder: [ROBOCHOC, "solve", str(folder / TEAM), *words], _own
    )


def _own(_folder: Path, run: Run) -> Answer:
    found = json.loads(run.output)
    return Answer(_verdict(found), found["metrics"]["messages"])


def _verdict(found: dict[str, object]) -> str:
    """A cost where there are costs."""
    if found.get("cost") is not None:
        return f"{found['cost']:g}"
    return str(found["verdict"])


def central(folder: Path) -> list[str]:
    """The command that finds what is right: one model of the whole problem, solved by ACE."""
    return [ROBOCHOC, "solve", str(folder / TEAM), "--json", "--protocol", "central"]


def right(run: Run) -> str:
    """Return the answer that the command has printed."""
    return _verdict(json.loads(run.output))


# FRODO


_FRODOS = {
    "SynchBB": ("SynchBB/SynchBBagent", "synchbb.SynchBBsolver"),
    "AFB": ("AFB/AFBagent", "afb.AFBsolver"),
    "ADOPT": ("ADOPT/ADOPTagent", "adopt.ADOPTsolver"),
    "DPOP": ("DPOP/DPOPagent", "dpop.DPOPsolver"),
    "MB-DPOP": ("DPOP/MB-DPOP/MB-DPOPagent", "dpop.DPOPsolver"),
    "O-DPOP": ("DPOP/O-DPOP/O-DPOPagent", "odpop.ODPOPsolver"),
    "P-DPOP": ("DPOP/P-DPOP/P-DPOPagent", "dpop.privacy.P_DPOPsolver"),
    "DUCT": ("DUCT/DUCTagent", "duct.DUCTsolver"),
    "DSA": ("DSA/DSAagent", "localSearch.dsa.DSAsolver"),
    "MGM": ("MGM/MGMagent", "localSearch.mgm.MGMsolver"),
    "Max-Sum": ("MaxSum/MaxSumAgent", "maxsum.MaxSumSolver"),
}
"""Of each algorithm, FRODO's description of its agents and the class that runs it."""
_COUNTED = {"threads": False, "threads, counting": True}


def _frodos(family: Family) -> list[Contestant]:
    if family is LOCAL:
        return [_frodo(name, "threads", family) for name in ("DSA", "MGM", "Max-Sum")]
    family_of_dpop = ("DPOP", "MB-DPOP", "O-DPOP", "P-DPOP", "DUCT")
    names = {COSTS: (*family_of_dpop, "SynchBB", "ADOPT", "AFB"), COLOURING: ("SynchBB", "AFB", "ADOPT", "DPOP")}
    return [_frodo(name, way, family) for name in names.get(family, ("SynchBB", "AFB")) for way in _COUNTED]


def _frodo(algorithm: str, way: str, family: Family) -> Contestant:
    agents, solver = _FRODOS[algorithm]
    home = Path(os.environ.get(FRODO, ""))
    source = home / "agents" / f"{agents}.xml"

    def command(folder: Path) -> list[str]:
        description, results = folder / "agents.xml", folder / "frodo.csv"
        description.write_text(described(source.read_text(), simulates_time=False, counts=_COUNTED[way]))
        results.unlink(missing_ok=True)
        classes = f"{home}/*:{home}/lib/*"
        words = [algorithm, f"frodo2.algorithms.{solver}", str(description), str(folder / FILES["frodo"])]
        limit = str(round(family.limit_s))
        return ["java", "-cp", classes, "frodo2.algorithms.AbstractDCOPsolver", *words, limit, str(results)]

    missing = "" if os.environ.get(FRODO) else f"{FRODO} names no folder of FRODO"
    if not missing and not source.exists():
        missing = f"{FRODO}: no agents/{agents}.xml there"
    return Contestant("FRODO", algorithm, way, command, _of_frodo, missing)


def _of_frodo(folder: Path, _run: Run) -> Answer:
    """The last line of the table that FRODO writes; only its own check of the cost is believed."""
    rows = list(csv.DictReader((folder / "frodo.csv").read_text().splitlines(), delimiter=";"))
    last = rows[-1]
    if last["timed out"] == "1":
        return Answer("its time is over")
    cost = last["true cost"]
    messages = int(last["number of messages"]) or None
    if cost == "null":
        return Answer("no answer")
    if cost == "infinity":
        return Answer("no-solution", messages)
    return Answer(cost, messages)


# pyDCOP


_ENDLESS = ("gdba", "mixeddsa", "adsa")
"""Algorithms that end by no number of cycles: they have `ENDLESS_S`, and what they have then is their answer."""
ENDLESS_S = 30


def _pydcops(family: Family) -> list[Contestant]:
    if family is LOCAL:
        counted = [_pydcop(name, family, f"stop_cycle:{CYCLES}") for name in ("dsa", "mgm")]
        return [*counted, *(_pydcop(name, family) for name in _ENDLESS)]
    if family is COSTS:
        return [_pydcop(name, family) for name in ("dpop", "syncbb")]
    return [_pydcop("dba" if family is COLOURING else "syncbb", family)]


def _pydcop(algorithm: str, family: Family, *parameters: str) -> Contestant:
    python = os.environ.get(PYTHON_OF_PYDCOP, "")
    algo = ["--algo", algorithm, *(word for one in parameters for word in ("--algo_params", one))]
    limit = str(ENDLESS_S if algorithm in _ENDLESS else round(family.limit_s))
    ended = ("FINISHED", "TIMEOUT") if algorithm in _ENDLESS else ("FINISHED",)

    def command(folder: Path) -> list[str]:
        once = str(SCRIPTS / "pydcop_once.py")
        return [python, once, "--timeout", limit, "solve", *algo, str(folder / FILES["pydcop"])]

    missing = "" if python else f"{PYTHON_OF_PYDCOP} names no Python"
    return Contestant("pyDCOP", algorithm, "threads", command, lambda _folder, run: _of_pydcop(run, ended), missing)


def _of_pydcop(run: Run, ended: tuple[str, ...]) -> Answer:
    found = json.loads(run.output[run.output.index("{") :])
    if found["status"] not in ended:
        return Answer(f"status {found['status']}")
    if found["cost"] is None:
        return Answer("a robot has no value")
    cost = float(found["cost"])
    return Answer("no-solution" if cost >= FORBIDDEN else f"{cost:g}", found["msg_count"])


# raven-csp


def _ravens(family: Family) -> list[Contestant]:
    if family in {COSTS, LOCAL}:
        return []
    ways = [("abt", "sim"), ("afc", "sim")]
    return [_raven(*way) for way in (*ways, *([("abt", "mp")] if family is COLOURING else []))]


def _raven(protocol: str, runtime: str) -> Contestant:
    python = os.environ.get(PYTHON_OF_RAVEN, "")
    missing = "" if python else f"{PYTHON_OF_RAVEN} names no Python"
    words = [str(HERE / "raven_once.py"), protocol, runtime]
    way = {"sim": "simulator", "mp": "processes"}[runtime]
    return Contestant(
        "raven-csp", protocol, way, lambda folder: [python, *words, str(folder / RAVEN)], _of_raven, missing
    )


def _of_raven(_folder: Path, run: Run) -> Answer:
    found = json.loads(run.output)
    return Answer("solution" if found["solved"] else "no-solution", found["messages"])


# PropFlow


def _propflows(family: Family) -> list[Contestant]:
    if family is not LOCAL:
        return []
    python = os.environ.get(PYTHON_OF_PROPFLOW, "")
    missing = "" if python else f"{PYTHON_OF_PROPFLOW} names no Python"
    words = [str(SCRIPTS / "propflow_once.py"), str(CYCLES)]
    return [
        Contestant(
            "PropFlow",
            "damped Max-Sum",
            "one loop",
            lambda folder: [python, *words, str(folder / TABLES)],
            _of_prices,
            missing,
        )
    ]


def _of_prices(_folder: Path, run: Run) -> Answer:
    found = json.loads(run.output.splitlines()[-1])
    return Answer("no-solution" if found["cost"] is None else f"{found['cost']:g}", found.get("messages"))


# Central solvers


def _centrals(family: Family) -> list[Contestant]:
    """One process that knows the whole problem: the price of having no centre."""
    if family is LOCAL:
        return []
    python = os.environ.get(PYTHON_OF_CENTRAL, "")
    missing = "" if python else f"{PYTHON_OF_CENTRAL} names no Python"
    whole = [_central(python, solver, missing) for solver in ("ortools", "toulbar2")]
    cosoco = str(Path(python).parent / "cosoco")
    no_costs = Contestant(
        "cosoco", "central", "one process", lambda folder: [cosoco, str(folder / FILES["xcsp3"])], _of_cosoco, missing
    )
    return whole if family is COSTS else [*whole, no_costs]


def _central(python: str, solver: str, missing: str) -> Contestant:
    words = [python, str(HERE / "central_once.py"), solver]
    name = {"ortools": "OR-Tools"}.get(solver, solver)
    return Contestant(
        name, "central", "one process", lambda folder: [*words, str(folder / TABLES)], _of_prices, missing
    )


def _of_cosoco(_folder: Path, run: Run) -> Answer:
    said = [line[2:].strip() for line in run.output.splitlines() if line.startswith("s ")]
    return Answer({"SATISFIABLE": "solution", "UNSATISFIABLE": "no-solution"}[said[-1]])


# DCOPSolver


def _nothing(_folder: Path) -> list[str]:
    return []


DCOPSOLVER = Contestant(
    "DCOPSolver", "-", "-", _nothing, lambda _folder, _run: Answer(""), "it has a window, and no command line"
)
