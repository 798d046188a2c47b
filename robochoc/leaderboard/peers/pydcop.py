"""pyDCOP (BSD): its command `pydcop solve`, with one thread for each agent.

Sources: pyDCOP's documentation, pages "pydcop solve" and "DCOP algorithms". `scripts/pydcop_once.py` calls the command.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import ClassVar

import msgspec

from robochoc.leaderboard.peers.peer import (
    CYCLES,
    SCRIPTS,
    Algorithm,
    Peer,
    PeerAnswer,
    PeerError,
    exported,
    last_line,
    violates,
)
from robochoc.leaderboard.peers.program import EndedProgram
from robochoc.model.problem import Team
from robochoc.system.plain_text import on_one_line

SCRIPT = SCRIPTS / "pydcop_once.py"
ENDLESS_S = 10.0
"""The time limit of algorithms that never end, in seconds."""
_PROBLEM, _RESULT = "problem.yaml", "result.json"
_INFINITY = re.compile(rb"^infinity: (\d{1,15})$", re.MULTILINE)
_BY_CYCLES = ("--algo_params", f"stop_cycle:{CYCLES}")
_BY_HINTS = ("--distribution", "adhoc")
_FINISHED, _TIMEOUT = "FINISHED", "TIMEOUT"


class _Result(msgspec.Struct):
    """The part of pyDCOP's result that is used."""

    status: str
    assignment: dict[str, int | float | str | None]
    cost: float | None = None
    msg_count: int | None = None


class Pydcop(Peer):
    """pyDCOP."""

    name = "pydcop"
    title = "pyDCOP"
    place_name = "PYTHON"
    install = (
        "install pyDCOP 0.1.2 in a virtual environment, pip install git+https://github.com/Orange-OpenSource/pyDcop"
        " 'numpy<2', and give its bin/python"
    )
    algorithms: ClassVar[Mapping[str, Algorithm]] = MappingProxyType(
        {
            "dpop": Algorithm(("dpop",), is_complete=True),
            "syncbb": Algorithm(("syncbb",), is_complete=True),
            "ncbb": Algorithm(("ncbb",), is_complete=True),
            "dsa": Algorithm(("dsa", *_BY_CYCLES)),
            "mgm": Algorithm(("mgm", *_BY_CYCLES)),
            "mgm2": Algorithm(("mgm2", *_BY_CYCLES)),
            "dba": Algorithm(("dba",)),
            "gdba": Algorithm(("gdba",), ends=False),
            "adsa": Algorithm(("adsa",), ends=False),
            "maxsum": Algorithm(("maxsum", *_BY_HINTS), ends=False),
            "amaxsum": Algorithm(("amaxsum", *_BY_HINTS), ends=False),
        }
    )

    def version(self) -> str:
        """Return the version printed by `pydcop --version`."""
        return self._reported(str(self.place), "-I", str(SCRIPT), "--version")

    def command(self, team: Team, algorithm: Algorithm, folder: Path, time_s: float) -> list[str]:
        """Write the problem, which is also a distribution: pyDCOP finds none for robots with several variables."""
        (folder / _PROBLEM).write_bytes(exported(team, "pydcop"))
        limit_s = time_s if algorithm.ends else min(time_s, ENDLESS_S)
        given = [] if _BY_HINTS[0] in algorithm.words else ["--distribution", _PROBLEM]
        options = ["--timeout", str(math.ceil(limit_s)), "--output", _RESULT]
        solve = ["solve", "--algo", *algorithm.words, *given, _PROBLEM]
        return [str(self.place), "-I", str(SCRIPT), *options, *solve]

    def answer(self, folder: Path, ended: EndedProgram) -> PeerAnswer:
        """Return the answer in the file of results. Its message sizes are not bytes, so they are not reported."""
        path = folder / _RESULT
        if not path.is_file():
            raise PeerError(last_line(ended) or f"ended with status {ended.status}, and wrote no result")
        try:
            found = msgspec.json.decode(path.read_bytes(), type=_Result)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as wrong:
            raise PeerError(f"its result cannot be read: {on_one_line(str(wrong), 200)}") from None
        if found.status not in {_FINISHED, _TIMEOUT}:
            raise PeerError(f"its status is {on_one_line(found.status, 40)}")
        values = {name: value for name, value in found.assignment.items() if isinstance(value, int)}
        cost = found.cost
        forbidden = _INFINITY.search((folder / _PROBLEM).read_bytes())
        if cost is not None and forbidden and violates(cost, int(forbidden[1])):
            cost = math.inf
        return PeerAnswer(values, cost, found.status == _FINISHED, found.msg_count)
