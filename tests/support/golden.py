"""The golden journals: fixed runs, kept in git. `make journals` rewrites them; a changed one is a changed protocol.

`python -m tests.support.golden PROTOCOL...` rewrites those of the named protocols.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Collection
from dataclasses import replace
from functools import cache

from robochoc.formats import read_team
from robochoc.generators.queens3d import queens3d
from robochoc.generators.tasks import tasks
from robochoc.journal.events import Given
from robochoc.journal.journal import Header, JournalRecorder, lines_of, read_journal
from robochoc.model.allocation import TasksModel
from robochoc.model.problem import Constraint, ProblemKind, Relation, Semantics, Team
from robochoc.run import Options, Runtime, ScheduleName, Withdrawal, solve
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.system.blake2 import blake2b
from tests.support.problems import team_of
from tests.support.program import ROOT

FOLDER = ROOT / "tests" / "golden"
PATROL = ROOT / "docs" / "examples" / "patrol"
RESCUE = ROOT / "docs" / "examples" / "rescue"
MOST_TELLING = {
    "abt-hyb": (("queens3d-2", ScheduleName.RANDOM), ("queens3d-3-full", ScheduleName.CONCURRENT)),
    "adopt": (("odd", ScheduleName.RANDOM), ("patrol", ScheduleName.CONCURRENT)),
    "adopt-k": (("odd", ScheduleName.CONCURRENT), ("patrol", ScheduleName.RANDOM)),
    "awc": (("queens3d-2", ScheduleName.CONCURRENT), ("queens3d-3-full", ScheduleName.RANDOM)),
    "bounded-maxsum": (("queens3d-2", ScheduleName.CONCURRENT), ("odd", ScheduleName.RANDOM)),
    "c-cocoa": (("odd", ScheduleName.CONCURRENT), ("patrol", ScheduleName.RANDOM)),
    "disfc": (("queens3d-2", ScheduleName.RANDOM), ("queens3d-3-full", ScheduleName.CONCURRENT)),
    "dsa": (("odd", ScheduleName.CONCURRENT), ("queens3d-3-full", ScheduleName.RANDOM)),
    "list-dpop": (("odd", ScheduleName.CONCURRENT), ("patrol", ScheduleName.RANDOM)),
    "maxsum": (("odd", ScheduleName.CONCURRENT), ("patrol", ScheduleName.RANDOM)),
    "maxsum-ad": (("odd", ScheduleName.CONCURRENT), ("queens3d-3-full", ScheduleName.RANDOM)),
    "mixed-dsa": (("odd", ScheduleName.CONCURRENT), ("queens3d-3-full", ScheduleName.RANDOM)),
    "ncbb": (("odd", ScheduleName.CONCURRENT), ("patrol", ScheduleName.RANDOM)),
    "p2-dpop": (("queens3d-2", ScheduleName.CONCURRENT), ("odd", ScheduleName.RANDOM)),
    "p-dsa": (("prices", ScheduleName.CONCURRENT), ("prices", ScheduleName.RANDOM)),
    "p-maxsum": (("prices", ScheduleName.CONCURRENT), ("prices", ScheduleName.RANDOM)),
    "p-mgm": (("prices", ScheduleName.CONCURRENT), ("prices", ScheduleName.RANDOM)),
    "pfd": (("odd", ScheduleName.CONCURRENT), ("patrol", ScheduleName.RANDOM)),
    "pc-syncbb": (("prices", ScheduleName.CONCURRENT), ("prices", ScheduleName.RANDOM)),
    "sfb": (("odd", ScheduleName.CONCURRENT), ("patrol", ScheduleName.RANDOM)),
}
"""Runs that noticed more of 34 mutants of the protocol than those that `files` takes else."""
_LONG = re.compile(rb'"([A-Za-z0-9+/=]{64,})"')


def odd_team(*, n_ary: bool = True) -> Team:
    """Four robots, a ternary constraint among them: A + B + C is even, and neighbours differ."""
    rows = tuple((a, b, c) for a in (1, 2, 3) for b in (1, 2, 3) for c in (1, 2, 3) if (a + b + c) % 2 == 0)
    even = Relation("even", 3, Semantics.SUPPORTS, rows)
    differ = Relation("differ", 2, Semantics.CONFLICTS, tuple((value, value) for value in (1, 2, 3)))
    pairs = (("A", "B"), ("B", "C"), ("A", "C"), ("C", "D"))
    constraints = [Constraint("C", differ, pair, pair) for pair in pairs]
    scope = ("A", "B", "C")
    if n_ary:
        constraints.append(Constraint("E", even, scope, scope))
    return team_of(dict.fromkeys("ABCD", (1, 2, 3)), constraints, "odd")


def prices_team() -> Team:
    """Three robots in a row, of two values each: neighbours pay for the same one, and for two of them."""
    rows = tuple((a, b) for a in (1, 2) for b in (1, 2))
    price = Relation("price", 2, Semantics.SOFT, rows, (2, 0, 1, 2))
    constraints = [Constraint("C", price, pair, pair) for pair in (("A", "B"), ("B", "C"))]
    team = team_of(dict.fromkeys("ABC", (1, 2)), constraints, "prices")
    return replace(team, robots=tuple(replace(robot, kind=ProblemKind.DISWCSP) for robot in team.robots))


@cache
def fixed_teams(protocol: str) -> dict[str, Team]:
    """Three small teams, by name; without the ternary constraint for a protocol that cannot take it.

    A protocol that goes on when the problem changes also has one that does; one that minimises, one with costs. One
    that takes task allocations only has two of these instead; one that encrypts its tables has smaller teams.
    """
    traits = protocol_named(protocol).traits
    if traits.allocates:
        return {f"tasks-{model}": tasks(3, 4, 2, model=model) for model in TasksModel}
    teams = {"queens3d-2": queens3d(2), "odd": odd_team(n_ary=traits.n_ary)}
    if traits.encrypted_tables:
        return {**teams, "prices": prices_team()}
    teams["queens3d-3-full"] = queens3d(3, "full")
    if traits.costs:
        teams["patrol"] = read_team(PATROL)
    return {**teams, "rescue": read_team(RESCUE)} if traits.dynamic else teams


def journal(team: Team, protocol: str, schedule: ScheduleName) -> bytes:
    """The journal of the fixed run, of a few cycles or samples, in its text form; it was written and read as a file is.

    The wall-clock time, which is not fixed, is left out, and so are the robots' files, which are no protocol's. Long
    strings of protocols with secret keys, mostly random bytes, are replaced by their digests.
    """
    withdraw = None if team.dynamic or team.kind is ProblemKind.DISWCSP else Withdrawal.MAXIMAL
    known = protocol_named(protocol).settings
    known_bits = hasattr(known, "bits")
    small = {"cycles": "1" if known_bits else "3", "samples": "3", "bits": "31", "particles": "3"}
    settings = {name: value for name, value in small.items() if hasattr(known, name)}
    options = Options(
        protocol=protocol,
        runtime=Runtime.SIMULATOR,
        schedule=schedule,
        withdraw=withdraw,
        settings=settings,
        repair=False,  # the journals are of the protocols alone
    )
    recorder = JournalRecorder(Header(team=team.name, protocol=protocol, runtime="simulator", seed=0))
    solve(team, options, observer=lambda event: None if isinstance(event, Given) else recorder(event))
    lines = b"".join(lines_of(read_journal(recorder.content())))
    return _LONG.sub(_digest, lines) if protocol_named(protocol).traits.secret_keys else lines


def _digest(long: re.Match[bytes]) -> bytes:
    return b'"%d characters, BLAKE2b %s"' % (len(long[1]), blake2b(long[1], digest_size=8).hexdigest().encode())


@cache
def files() -> dict[str, tuple[str, str, ScheduleName]]:
    """The golden journals of our own protocols, two of each: the protocol, the team and the schedule, by file name."""
    found = {}
    for protocol in protocol_names():
        if protocol_named(protocol).__module__.startswith("robochoc."):
            *_, former, latter = fixed_teams(protocol)
            default = ((former, ScheduleName.CONCURRENT), (latter, ScheduleName.RANDOM))
            for team, schedule in MOST_TELLING.get(protocol, default):
                found[f"{protocol}/{team}-{schedule}.jsonl"] = (protocol, team, schedule)
    return found


def content(file: str) -> bytes:
    """Return the journal called `file` as it should be."""
    protocol, team, schedule = files()[file]
    return journal(fixed_teams(protocol)[team], protocol, schedule)


def rewrite(protocols: Collection[str]) -> None:
    """Rewrite the golden journals of `protocols`, or all if there are none."""
    for file, (protocol, _, _) in files().items():
        if not protocols or protocol in protocols:
            (FOLDER / file).parent.mkdir(parents=True, exist_ok=True)
            (FOLDER / file).write_bytes(content(file))
            print(FOLDER / file)  # noqa: T201 - a script's output


def main() -> None:
    """Rewrite what is asked for."""
    parser = argparse.ArgumentParser(description="Rewrite the golden journals in tests/golden.")
    parser.add_argument("protocols", nargs="*", metavar="PROTOCOL", help="only those of this protocol; all without one")
    protocols = parser.parse_args().protocols
    known = {protocol for protocol, _, _ in files().values()}
    if unknown := sorted({*protocols} - known):
        parser.error(f"no protocol of robochoc: {', '.join(unknown)}")
    rewrite(protocols)


if __name__ == "__main__":
    main()
