"""Runs of the whole program whose search never ends by itself, moments of them, and what they must leave behind."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import Lost, Sent
from robochoc.journal.journal import Follower, read_journal
from robochoc.model.problem import Team
from tests.support.faults import PROGRAM, Run, running
from tests.support.limits import wait_until

TEAM, CROWD = queens3d(4), queens3d(8)
"""16 robots, and 64."""
OLD = b"what was here before"
_ENDLESS = ("--protocol", "dsa", "--set", "cycles=1000000000", "--timeout", "3600")
"""Robots that act in so many cycles, and stop for no solution."""


NAMES = {team.name: [robot.name for robot in team.robots] for team in (TEAM, CROWD)}
"""The robots of a team, in the order in which their processes start."""


def team_folder(team: Team, home: Path) -> Path:
    """Write the team's files to a folder of its name in `home`, and return that."""
    write_team(team, home / team.name)
    return home / team.name


def solving(folder: Path, *options: str) -> list[str]:
    return [PROGRAM, "solve", str(folder), *options]


@contextmanager
def searching(folder: Path, home: Path, *options: str, watched: bool = False) -> Iterator[Run]:
    """A run whose search does not end; one that is `watched` has all its outputs, which replace something older.

    Args:
        folder: The files of one of the teams, as `team_folder` writes them.
        home: A folder that is made for the outputs.
        options: More options of `robochoc solve`.
        watched: Whether it writes `home`/run.journal and `home`/scene.html.
    """
    home.mkdir()
    outputs = {"--journal": home / "run.journal", "--html": home / "scene.html"} if watched else {}
    for path in outputs.values():
        path.write_bytes(OLD)
    words = [word for option, path in outputs.items() for word in (option, str(path))]
    with running(solving(folder, *_ENDLESS, *words, *options), home) as run:
        run.names = NAMES[folder.name]
        yield run
    if watched:
        assert (home / "scene.html").read_bytes() == OLD


# Moments

Moment = Callable[[Run], None]
"""Waits until a run has come to it."""


def at_the_start(run: Run) -> None:
    """The first robot has a process, the last one hardly."""
    run.wait_for_robots(1)


def in_the_middle(run: Run) -> None:
    """All robots talk."""
    robots = run.wait_for_robots(len(run.names))
    wait_until(lambda: run.is_over or all(_talks(pid) for pid in robots), "they do not talk")


def once_it_is_told(run: Run) -> None:
    """The journal of a watched run tells of messages."""
    path = run.home / "run.journal"
    wait_until(lambda: path.read_bytes() != OLD, "it never began")
    with path.open("rb") as file:
        follower = Follower(file)
        wait_until(lambda: any(isinstance(line, Sent) for line in follower.read()), "nobody says anything")


def listening_for(pause_s: float) -> Moment:
    """So long after the program has begun to listen to signals: in whatever state it is then."""

    def moment(run: Run) -> None:
        run.wait_until_listening()
        time.sleep(pause_s)

    return moment


def _talks(pid: int) -> bool:
    """Whether the robot has written so often to pipes, as it does when it speaks, that the start is long over."""
    with suppress(OSError):
        return int(Path(f"/proc/{pid}/io").read_text().split("syscw: ")[1].split()[0]) > 20
    return False


# Afterwards


def nothing_is_left(run: Run) -> None:
    assert "Traceback" not in run.errors()
    assert "Exception ignored" not in run.errors()
    assert len(run.errors().splitlines()) <= 2, run.errors()
    # Another test's semaphore is in /dev/shm for a moment, until Python unlinks it.
    wait_until(lambda: not run.left_behind(), lambda: f"left behind: {run.left_behind()}")


def the_journal_is_whole(content: bytes, lost: list[str], *, killed: bool) -> None:
    """It tells who was lost. That of a run just begun need not be there, that of a killed one may end anywhere."""
    if not lost and content == OLD:
        return
    journal = read_journal(content)
    assert journal.outcome is None
    assert journal.damage is None or (killed and "it ends within a block" in journal.damage)
    assert [event.robot for event in journal.events if isinstance(event, Lost)] == lost
