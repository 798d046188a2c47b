"""The golden journals: fixed runs, kept in git. `make journals` rewrites them; a changed one is a changed protocol."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from problems import team_of

from robochoc.generators.queens3d import queens3d
from robochoc.observers.journal import Header, Recorder
from robochoc.problem import Constraint, Relation, Semantics, Team
from robochoc.registry import protocol_named, protocol_names
from robochoc.run import Options, Runtime, ScheduleName, Withdrawal, solve

FOLDER = Path(__file__).parent / "golden"


def odd_team() -> Team:
    """Four robots, a ternary constraint among them: A + B + C is even, and neighbours differ."""
    rows = tuple((a, b, c) for a in (1, 2, 3) for b in (1, 2, 3) for c in (1, 2, 3) if (a + b + c) % 2 == 0)
    even = Relation("even", 3, Semantics.SUPPORTS, rows)
    differ = Relation("differ", 2, Semantics.CONFLICTS, tuple((value, value) for value in (1, 2, 3)))
    pairs = (("A", "B"), ("B", "C"), ("A", "C"), ("C", "D"))
    constraints = [Constraint("C", differ, pair, pair) for pair in pairs]
    scope = ("A", "B", "C")
    return team_of(dict.fromkeys("ABCD", (1, 2, 3)), [*constraints, Constraint("E", even, scope, scope)], "odd")


TEAMS: dict[str, Callable[[], Team]] = {
    "queens3d-2": lambda: queens3d(2),
    "queens3d-3-full": lambda: queens3d(3, "full"),
    "odd": odd_team,
}


def journal(team: Team, protocol: str, schedule: ScheduleName) -> bytes:
    """The journal of the fixed run; the wall-clock time, which is not fixed, is left out."""
    options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, schedule=schedule, withdraw=Withdrawal.MAXIMAL)
    recorder = Recorder(Header(team=team.name, protocol=protocol, runtime="simulator", seed=0))
    solve(team, options, observer=recorder)
    return recorder.content()


def journals(protocol: str) -> dict[str, bytes]:
    """All golden journals of a protocol, by file name."""
    return {
        f"{protocol}-{name}-{schedule}.jsonl": journal(make(), protocol, schedule)
        for name, make in TEAMS.items()
        if name != "odd" or protocol_named(protocol).traits.n_ary
        for schedule in ScheduleName
    }


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for protocol in protocol_names():
        for file, content in journals(protocol).items():
            (FOLDER / file).write_bytes(content)
            print(FOLDER / file)  # noqa: T201 - a script's output
