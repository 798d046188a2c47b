"""Part `network`: what a message costs on its way across a network, and a run; all of it on this machine."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from measure import ROBOCHOC, Sample, say, spread, timed_command
from report import Row, Section

from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d

ONCE = str(Path(__file__).with_name("network_once.py"))
READING = Path(__file__).with_name("network.md")
ROUNDS = 3
FLAGSHIP = 11
LIMIT_S = 60
UNKNOWN = 3
"""The exit status of a run that reached its time limit."""
JOINED = {
    "pipe": "multiprocessing.Pipe",
    "queue": "the processes runtime's queues",
    "zenoh": "zenoh, plain: TCP, a router, publishers and subscribers",
    "post": "the post: mutual TLS, access control, advanced publishers",
    "watched": "the post, the router telling of refusals",
    "processes": "robots in processes",
    "network": "robots on the network",
    "network-signed": "robots on the network, signed",
    "network-sealed": "robots on the network, signed and sealed",
}
RUNTIMES = {
    "processes": ["--runtime", "processes"],
    "network": ["--runtime", "network"],
    "network, signed and sealed": ["--runtime", "network", "--filter", "signed", "--filter", "sealed"],
}
SIDES = (4, 7)


def measured() -> Section:
    """Messages, whole runs, and 121 robots."""
    notes = (
        "All on this machine, by loopback. *Messages*: two processes hit balls of about 200 bytes to and fro. One ball "
        "shows the round trip, 200 at once how many messages a second get through, in both directions together; the "
        "opening, and each pair's first message, are not in it. Robots do the same with a protocol; the host, its "
        "clocks, letters and counters are in it then. *Runs*: `robochoc solve FOLDER --json`, from fork to exit. "
        f"*121 robots*: 3D queens, n = {FLAGSHIP}, planar, with ABT, once; memory is that of all robots, shared "
        f"pages in parts (PSS). Limit {LIMIT_S} s. Median (min..max) of {ROUNDS} rounds in turns."
    )
    notes += f"\n\n{READING.read_text().strip()}"
    return Section("network", "Across a network", notes, (_messages(), _runs(), _flagship()))


def _messages() -> list[Row]:
    figures = _in_turns(
        {f"{what} {game}": _once(what, game) for what in JOINED for game in ("one", "many")},
    )
    rows: list[Row] = [("joined by", "round trip, us", "thousand messages a second")]
    for what, name in JOINED.items():
        one, many = (
            [sample.answer["seconds"] / sample.answer["messages"] for sample in figures[f"{what} {game}"]]
            for game in ("one", "many")
        )
        trips = spread((2e6 * each for each in one), 0)
        rows.append((name, trips, spread((1e-3 / each for each in many), 1)))
    return rows


def _runs() -> list[Row]:
    rows: list[Row] = [("problem", "runtime", "wall s", "messages", "NCCCs")]
    with tempfile.TemporaryDirectory() as scratch:
        folders = {side: Path(scratch) / f"queens3d-{side}" for side in SIDES}
        for side, folder in folders.items():
            write_team(queens3d(side), folder)
        takes = {
            f"3D queens, n = {side} | {runtime}": _command([ROBOCHOC, "solve", str(folder), "--json", *options])
            for side, folder in folders.items()
            for runtime, options in RUNTIMES.items()
        }
        for case, samples in _in_turns(takes).items():
            problem, runtime = case.split(" | ")
            counts = [spread((one.answer["metrics"][what] for one in samples), 0) for what in ("messages", "ncccs")]
            rows.append((problem, runtime, spread(one.wall_s for one in samples), *counts))
    return rows


def _flagship() -> list[Row]:
    say(f"{FLAGSHIP * FLAGSHIP} robots on the network")
    found: dict[str, Any] = _once("team", str(FLAGSHIP))().answer
    figures = (
        f"{found['registered_s']:.1f}",
        f"{found['search_s']:.1f}",
        str(found["verdict"]),
        f"{found['messages']:,}",
        f"{found['memory_mb']:,.0f}",
        f"{found['threads']:,}",
        f"{found['descriptors']:,}",
    )
    head = ("all registered, s", "search, s", "verdict", "messages", "memory, MB", "threads", "descriptors")
    return [head, figures]


def _in_turns(takes: dict[str, Callable[[], Sample]]) -> dict[str, list[Sample]]:
    """All samples, each case once a round."""
    samples: dict[str, list[Sample]] = {case: [] for case in takes}
    for turn in range(1, ROUNDS + 1):
        say(f"network, {len(takes)} cases, round {turn}")
        for case, take in takes.items():
            samples[case].append(take())
    return samples


def _once(*words: str) -> Callable[[], Sample]:
    return _command([sys.executable, ONCE, *words])


def _command(command: Sequence[str]) -> Callable[[], Sample]:
    return lambda: timed_command(command, expected=(0, UNKNOWN))
