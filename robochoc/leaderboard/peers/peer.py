"""The interface of a peer: another tool that solves instances of the benchmark set in a process of its own."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from robochoc.formats.dialects.dialect import ExportOptions
from robochoc.formats.dialects.registry import find_dialect
from robochoc.leaderboard.peers.program import EndedProgram, run_program
from robochoc.model.problem import Team
from robochoc.run.registry import UnknownProtocolError
from robochoc.solver.errors import UnsupportedError
from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.plain_text import on_one_line
from robochoc.system.temporary_files import PrivateFolder

START_S = 60.0
"""The maximum seconds until a peer has reported its version."""
CYCLES = 100
"""The number of cycles of the peers' local searches and belief propagation."""
SCRIPTS = Path(__file__).with_name("scripts")


class PeerError(RobochocError):
    """A peer failed, or its answer cannot be read."""


class UnusablePeerError(UnknownProtocolError):
    """A peer or its algorithm is unknown, or its program is missing. The message says where to get it."""


@dataclass(frozen=True)
class Algorithm:
    """An algorithm of a peer.

    Attributes:
        words: The peer's name of the algorithm, and its settings.
        is_complete: True if an answer at its own end claims the optimum, or that there is no solution.
        ends: False if it only ends at a time limit, which is then not a fault.
    """

    words: tuple[str, ...]
    is_complete: bool = False
    ends: bool = True


@dataclass(frozen=True)
class PeerAnswer:
    """An answer as a peer reported it.

    Attributes:
        assignment: The values by variables.
        cost: The cost that the peer states. None: not stated. Infinite: its assignment violates hard constraints.
        is_finished: True if the algorithm ended before its time limit.
        messages: The number of messages, as the peer counts them. None: not counted.
        bytes: The bytes of the messages.
        ncccs: The non-concurrent constraint checks.
    """

    assignment: Mapping[str, int]
    cost: float | None
    is_finished: bool
    messages: int | None = None
    bytes: int | None = None
    ncccs: int | None = None


class Peer(ABC):
    """An adapter of another tool.

    Args:
        place: The path of its program or library, as given by the user.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    place_name: ClassVar[str]
    """The kind of `place`, in capital letters."""
    install: ClassVar[str]
    """A sentence about how to get the tool."""
    algorithms: ClassVar[Mapping[str, Algorithm]]

    def __init__(self, place: Path) -> None:
        self.place = place

    @abstractmethod
    def version(self) -> str:
        """Return the tool's name and version. Raises `UnusablePeerError` if it cannot be used."""

    @abstractmethod
    def command(self, team: Team, algorithm: Algorithm, folder: Path, time_s: float) -> list[str]:
        """Write the files for a run into `folder`, and return the command.

        Args:
            team: The problem.
            algorithm: The algorithm.
            folder: An empty folder.
            time_s: The time limit, which the tool should impose on itself.

        Raises:
            UnsupportedError: if the tool's format cannot express the problem.
        """

    @abstractmethod
    def answer(self, folder: Path, ended: EndedProgram) -> PeerAnswer:
        """Return the answer in `folder`, or in the output of the program. Raises `PeerError` if there is none."""

    def unusable(self, reason: str) -> UnusablePeerError:
        """Return the error for a program that cannot be used."""
        return UnusablePeerError(f"--peer {self.name}={self.place}: {reason}; {self.install}")

    def _reported(self, *command: str) -> str:
        """Return the first line that a command prints. Raises `UnusablePeerError` if it fails."""
        with PrivateFolder() as folder:
            try:
                ended = run_program(command, folder, START_S)
            except OSError as error:
                raise self.unusable(f"cannot be started ({error.strerror})") from None
        if ended.status != 0:
            raise self.unusable(last_line(ended) or f"ended with status {ended.status}")
        return on_one_line(ended.output.strip(), 100)


def exported(team: Team, dialect_name: str) -> bytes:
    """Return a team in another format. Raises `UnsupportedError` if the format cannot express it."""
    dialect = find_dialect(dialect_name)
    if dialect is None or dialect.write is None:
        raise UnsupportedError(f"this version cannot write {dialect_name}")
    return next(iter(dialect.write(team, ExportOptions()).files.values()))


def violates(cost: float, forbidden: float) -> bool:
    """Return whether a total cost includes that of a forbidden tuple, which is ten times any sum of finite costs."""
    return abs(cost) > forbidden / 2


def last_line(ended: EndedProgram) -> str:
    """Return the last line that a program wrote about an error, in a form safe for display."""
    lines = (ended.errors.strip() or ended.output.strip()).splitlines()
    return on_one_line(lines[-1].strip(), 300) if lines else ""
