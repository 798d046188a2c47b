"""FRODO 2 (AGPL): its public command `frodo2.algorithms.AgentFactory`, with the agents described in its jar.

Sources: FRODO's manual (https://manual.frodo-ai.tech), sections 4 and 5 and Appendix A. The agents are used as shipped,
but count messages, bytes and checks, in FRODO's simulated time.
"""

from __future__ import annotations

import math
import re
import shutil
import zipfile
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import ClassVar

from robochoc.formats.diagnostics import InvalidInputError
from robochoc.formats.xml import parsed_tree
from robochoc.leaderboard.peers.peer import Algorithm, Peer, PeerAnswer, PeerError, exported, last_line
from robochoc.leaderboard.peers.program import LARGEST_FILE, EndedProgram
from robochoc.model.problem import Team
from robochoc.system.archives import DAMAGED

MEMORY = "4g"
_DIGITS = 15
"""The maximum number of digits of a number in its output."""
_MAIN = "frodo2.algorithms.AgentFactory"
_RESOURCES = "frodo2/algorithms/"
_TOTAL = re.compile(r"- Total:\s*([\d,]+)")
_NCCCS = re.compile(r"^Number of NCCCs = ([\d,]+)", re.MULTILINE)
_BYTES = "Amount of information sent"
_LATE = "Timed out after"


class Frodo(Peer):
    """FRODO."""

    name = "frodo"
    title = "FRODO"
    place_name = "JAR"
    install = "FRODO 2.18 is at https://frodo-ai.tech: give its jar, beside its folder lib, and install Java"
    algorithms: ClassVar[Mapping[str, Algorithm]] = MappingProxyType(
        {
            "dpop": Algorithm(("dpop/DPOPagent.xml",), is_complete=True),
            "mb-dpop": Algorithm(("dpop/memory/MB-DPOPagent.xml",), is_complete=True),
            "o-dpop": Algorithm(("odpop/ODPOPagent.xml",), is_complete=True),
            "p-dpop": Algorithm(("dpop/privacy/P-DPOPagent.xml",), is_complete=True),
            "syncbb": Algorithm(("synchbb/SynchBBagent.xml",), is_complete=True),
            "afb": Algorithm(("afb/AFBagent.xml",), is_complete=True),
            "adopt": Algorithm(("adopt/ADOPTagent.xml",), is_complete=True),
            "dsa": Algorithm(("localSearch/dsa/DSAagent.xml",)),
            "mgm": Algorithm(("localSearch/mgm/MGMagent.xml",)),
            "mgm2": Algorithm(("localSearch/mgm/mgm2/MGM2agent.xml",)),
            "maxsum": Algorithm(("maxsum/MaxSumAgent.xml",)),
            "duct": Algorithm(("duct/DUCTagent.xml",)),
        }
    )

    def version(self) -> str:
        """Return the name of the jar; it contains no version."""
        self._agents(self.algorithms["dpop"])
        if shutil.which("java") is None:
            raise self.unusable("Java is not installed")
        return f"{self.title} ({self.place.name})"

    def command(self, team: Team, algorithm: Algorithm, folder: Path, time_s: float) -> list[str]:
        """Write the problem and the description of the agents."""
        problem, agents = folder / "problem.xml", folder / "agents.xml"
        problem.write_bytes(exported(team, "frodo"))
        description = self._agents(algorithm).decode(errors="replace")
        agents.write_text(described(description, simulates_time=True, counts=True), encoding="utf-8")
        classes = f"{self.place.resolve()}:{self.place.resolve().parent / 'lib' / '*'}"
        java = ["java", f"-Xmx{MEMORY}", "-Duser.language=en", "-Duser.country=US", "-cp", classes]
        return [*java, _MAIN, "-timeout", str(round(1000 * time_s)), "-o", "solution.xml", problem.name, agents.name]

    def answer(self, folder: Path, ended: EndedProgram) -> PeerAnswer:
        """Return the solution in the file, with the counts in the output."""
        path = folder / "solution.xml"
        if not path.is_file():
            raise PeerError(last_line(ended) or f"ended with status {ended.status}, and wrote no solution")
        try:
            found = parsed_tree(path.read_bytes(), path, LARGEST_FILE)
        except InvalidInputError as wrong:
            raise PeerError(str(wrong)) from None
        values = {one.get("variable", ""): _value(one.get("value", "")) for one in found.iter("assignment")}
        messages, _, information = ended.output.partition(_BYTES)
        finished = ended.status == 0 and _LATE not in ended.errors
        counts = (_count(_TOTAL, messages), _count(_TOTAL, information), _count(_NCCCS, ended.output))
        return PeerAnswer(values, _cost(found.get("valuation")), finished, *counts)

    def _agents(self, algorithm: Algorithm) -> bytes:
        """Return the description of the agents in the jar. Raises `UnusablePeerError` if it is not FRODO's jar."""
        try:
            with zipfile.ZipFile(self.place) as jar, jar.open(_RESOURCES + algorithm.words[0]) as file:
                return file.read(LARGEST_FILE)
        except FileNotFoundError:
            raise self.unusable("does not exist") from None
        except (*DAMAGED, KeyError):
            raise self.unusable(f"is not FRODO's jar, with {_RESOURCES}{algorithm.words[0]}") from None


def described(text: str, *, simulates_time: bool, counts: bool) -> str:
    """Return FRODO's description of agents with other settings of its clock and counters, and no drawn graph.

    Args:
        text: The description.
        simulates_time: True if FRODO simulates the time, in one thread. False: the agents are threads.
        counts: True if it counts messages, bytes and constraint checks.
    """
    settings = {"measureTime": simulates_time, "measureMsgs": counts, "countNCCCs": counts, "displayGraph": False}
    for name, value in settings.items():
        text = re.sub(rf'\b{name}(\s*)=(\s*)"\w+"', rf'{name}\1=\2"{str(value).lower()}"', text)
    return text


def _value(text: str) -> int:
    try:
        return int(text[:_DIGITS])
    except ValueError:
        raise PeerError("a value of its solution is not an integer") from None


def _cost(text: str | None) -> float | None:
    """Return a cost, which FRODO writes as a number or `infinity`."""
    if text is None or text == "null":
        return None
    try:
        cost = float(text)
    except ValueError:
        raise PeerError("the valuation of its solution is not a number") from None
    return math.inf if math.isnan(cost) else abs(cost) if math.isinf(cost) else cost


def _count(pattern: re.Pattern[str], text: str) -> int | None:
    """Return the first number that a pattern finds."""
    found = pattern.search(text)
    digits = found[1].replace(",", "") if found else ""
    return int(digits) if 0 < len(digits) <= _DIGITS else None
