"""Machines as users have them: each with a data folder of its own, on which the program is started and ended."""

from __future__ import annotations

import itertools
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

from click.testing import CliRunner

from robochoc.cli.group import cli
from robochoc.formats import write_team
from robochoc.model.problem import Constraint, Team
from tests.support.limits import HANG_S, wait_until
from tests.support.ports import LOOPBACK, free_port
from tests.support.problems import PREDICATES, team_of
from tests.support.program import ROOT
from tests.support.warm_programs import HURRY, WarmProcess, WarmPrograms

LONG_S = HANG_S
_DIFFERENT = [Constraint("C", PREDICATES[0], pair, pair) for pair in (("A", "B"), ("B", "C"), ("A", "C"))]
PAIR = team_of(dict.fromkeys("AB", range(1, 3)), _DIFFERENT[:1])
TRIANGLE = team_of(dict.fromkeys("ABC", range(1, 3)), _DIFFERENT)
CROWD = team_of(
    dict.fromkeys("ABCDE", range(1, 5)),
    [Constraint("C", PREDICATES[0], pair, pair) for pair in itertools.combinations("ABCDE", 2)],
)
"""One robot more than there are values: told to be so (`sbt`) after many messages."""


class Program:
    """A process that was started as a user would, with what it prints in files.

    `command` is `robochoc`'s words where there are `warm` programs to start it from.
    """

    def __init__(
        self, command: Sequence[object], home: Path, warm: WarmPrograms | None = None, inside: str = ""
    ) -> None:
        home.mkdir(parents=True, exist_ok=True)
        stem = str(len(list(home.iterdir())))
        self._out, self._err = home / f"{stem}.out", home / f"{stem}.err"
        environment = {**os.environ, "XDG_DATA_HOME": str(home), "PYTHONPATH": str(ROOT)}
        words = list(map(str, command))
        self._process: subprocess.Popen[bytes] | WarmProcess
        with self._out.open("wb") as out, self._err.open("wb") as err:
            if warm:
                self._process = warm.start(words, out, err, environment, home, inside)
            else:
                self._process = subprocess.Popen(
                    words, stdin=subprocess.DEVNULL, stdout=out, stderr=err, env=environment, cwd=home
                )
        self.pid = self._process.pid

    @property
    def output(self) -> str:
        """What it has printed."""
        return self._out.read_text()

    @property
    def errors(self) -> str:
        """What it has said on standard error."""
        return self._err.read_text()

    @property
    def object(self) -> dict[str, Any]:
        """What it has printed, one JSON object."""
        found: dict[str, Any] = json.loads(self.output)
        return found

    @property
    def is_running(self) -> bool:
        """Whether it has not ended yet."""
        return self._process.poll() is None

    def wait_to_say(self, words: str, times: int = 1) -> None:
        """Wait until `words` stand on its standard error."""

        def said() -> bool:
            assert self._process.poll() is None or self.errors.count(words) >= times, self.errors
            return self.errors.count(words) >= times

        wait_until(said, lambda: f"{words!r} was never said: {self.errors}")

    def wait_to_print(self, words: str) -> None:
        """Wait until `words` stand on its standard output."""
        wait_until(lambda: words in self.output, lambda: f"{words!r} was never printed: {self.output} {self.errors}")

    def hurry_until(self, done: Callable[[], bool]) -> None:
        """Let days pass for it until `done()`: whatever it waits for in vain is over. Programs that start warm only."""

        def hurried() -> bool:
            self._process.send_signal(HURRY)
            return done()

        wait_until(hurried, lambda: f"it goes on for days: {self.errors}")

    def hurried_status(self) -> int:
        """Its exit status; it has ended because its patience was over."""
        self.hurry_until(lambda: not self.is_running)
        return self.status()

    def status(self, within_s: float = LONG_S) -> int:
        """Its exit status, once it has ended; no program ends with a traceback."""
        status = self._process.wait(within_s)
        assert "Traceback" not in self.errors, self.errors
        return status

    def strike(self, signum: signal.Signals) -> None:
        """Send it a signal."""
        self._process.send_signal(signum)

    def kill(self) -> None:
        """End it at once, if it has not ended."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()


Crew = dict[str, Program]
"""Robots by name."""


class Deployment:
    """Machines around one master at `place`, with an Authority, below `folder`. A context manager: none outlives it.

    `inside` names a network namespace. Programs are forked from `warm`, if it is given.
    """

    def __init__(
        self, folder: Path, host: str = LOOPBACK, port: int | None = None, warm: WarmPrograms | None = None
    ) -> None:
        self.folder = folder
        self._warm = warm
        self.port = port or free_port(host, 2)  # the Authority's service is at the second
        self.place = f"{host}:{self.port}"
        self.authority_folder = folder / "authority"
        self._programs: list[Program] = []
        self.authority("init")

    def authority(self, *words: object) -> str:
        """What `robochoc authority` prints."""
        done = CliRunner().invoke(cli, ["authority", *map(str, words), "--authority", str(self.authority_folder)])
        assert done.exit_code == 0, done.output
        return done.stdout

    def enrol(self, *words: object) -> dict[str, str]:
        """The tokens of all whom `words` enrol, by their names."""
        rows = [json.loads(line) for line in self.authority("enrol", *words, "--json").splitlines()]
        return {row["name"]: row["token"] for row in rows}

    def start(self, machine: str, *words: object, inside: str = "") -> Program:
        """Start the program on `machine`."""
        if self._warm:
            program = Program(words, self.folder / machine, self._warm, inside)
        else:
            program = Program([sys.executable, "-m", "robochoc", *words], self.folder / machine)
        self._programs.append(program)
        return program

    def script(self, machine: str, text: str) -> Program:
        """Start a Python program on `machine`."""
        program = Program([sys.executable, "-c", text], self.folder / machine)
        self._programs.append(program)
        return program

    def master(self, *words: object, inside: str = "") -> Program:
        """Start a master, and wait until robots can come."""
        listening = ("--listen", self.place, "--authority", self.authority_folder)
        program = self.start("master", "master", *listening, *words, inside=inside)
        program.wait_to_say("listening at")
        return program

    def robot(self, file: Path, *words: object, inside: str = "") -> Program:
        """Start a robot."""
        return self.start(file.stem, "robot", file.resolve(), "--master", self.place, *words, inside=inside)

    def robots(self, files: Path, tokens: Mapping[str, str], *words: object) -> dict[str, Program]:
        """Start all robots of the folder `files` that there are tokens for."""
        return {n: self.robot(files / f"{n}.xml", "--token", token, *words) for n, token in tokens.items()}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for program in reversed(self._programs):
            program.kill()


@contextmanager
def taken(port: int, host: str = LOOPBACK) -> Iterator[None]:
    """Somebody else listens there."""
    with socket.create_server((host, port)):
        yield


def ended(programs: Mapping[str, Program], status: int = 0) -> None:
    """Wait until all have ended, with that status."""
    found = {name: program.status() for name, program in programs.items()}
    others = {name: (it, programs[name].errors) for name, it in found.items() if it != status}
    assert not others, others


def finished(
    site: Deployment, files: Path, *words: object, robots: Sequence[object] = (), status: int = 0
) -> tuple[Program, Crew]:
    """Return the master and the robots of a run that all have ended with `status`.

    Args:
        site: The machines.
        files: The folder of the team, all of whose robots are enrolled.
        words: Options of the master.
        robots: Options of each robot.
        status: Their exit status.
    """
    tokens = site.enrol("--team", files)
    master = site.master(*words)
    crew = site.robots(files, tokens, *robots)
    assert master.status() == status, master.errors
    ended(crew, status)
    return master, crew


def written(team: Team, site: Deployment) -> Path:
    folder = site.folder / "files"
    write_team(team, folder)
    return folder


def enrolled(team: Team, site: Deployment) -> tuple[Path, dict[str, str]]:
    """Return the files of the team, and the tokens of its robots."""
    files = written(team, site)
    return files, site.enrol("--team", files)


def one_line(program: Program) -> str:
    """All that a program says that did not get far."""
    assert program.errors.count("\n") == 1, program.errors
    return program.errors
