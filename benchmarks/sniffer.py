"""Part `sniffer`: what it costs to be watched, and how soon a page shows something."""

from __future__ import annotations

import os
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from measure import ROBOCHOC, ROOT, FailedError, say, spread
from report import Row, Section
from sniffer_page import STOPPED

RUNS = 15
"""Runs of these differ more than others: which robot is first changes the search."""
_SOLVE = (ROBOCHOC, "solve", "instances/queens3d-7", "--json")
_PAGE = str(Path(__file__).with_name("sniffer_page.py"))
_PATIENCE_S = 60.0
_WAYS: dict[str, tuple[str, ...]] = {
    "plain": (),
    "--journal": ("--journal", "{scratch}/run.journal"),
    "--sniff, nobody looks": ("--sniff",),
    "--sniff --open, a page follows": ("--sniff", "--open"),
    "--sniff --open, the page is stopped (SIGSTOP)": ("--sniff", "--open"),
}
MESSAGES = 1_000_000


def measured() -> Section:
    """Time every way of being watched, in turns, and the first answers about a long journal."""
    say("runs that are watched")
    with tempfile.TemporaryDirectory() as scratch:
        samples: dict[str, list[tuple[float, float]]] = {way: [] for way in _WAYS}
        for _ in range(RUNS):
            for way, options in _WAYS.items():
                words = tuple(option.format(scratch=scratch) for option in options)
                samples[way].append(_run_s(words, scratch, stopped="SIGSTOP" in way))
        rows: list[Row] = [("way", "wall s", "times plain", "us a message", "times plain")]
        plain = [statistics.median(values) for values in zip(*samples["plain"], strict=True)]
        for way, found in samples.items():
            wall, each = ([one[place] for one in found] for place in range(2))
            rows.append(
                (
                    way,
                    spread(wall),
                    f"{statistics.median(wall) / plain[0]:.2f}",
                    spread((1e6 * one for one in each), 0),
                    f"{statistics.median(each) / plain[1]:.2f}",
                )
            )
        first = _first(Path(scratch))
    notes = (
        f"ABT on queens3d n = 7 in 49 processes, {RUNS} runs of each in turns: from fork to the result on standard "
        "output, median (min..max). Runs differ in how many messages they take, hence the time per message. The page "
        f"is a program that asks for what a browser's asks for. Then a journal of {MESSAGES:,} messages: seconds from "
        "the start of `robochoc sniff` to the URL, to the first answers that a picture takes, and to all of it."
    )
    return Section("sniffer", "Being watched", notes, (rows, first))


def _run_s(options: tuple[str, ...], scratch: str, *, stopped: bool) -> tuple[float, float]:
    """Seconds until the result is told, in all and per message."""
    follow = f"{sys.executable} {_PAGE} %s {'stop' if stopped else 'follow'} &"
    began = time.perf_counter()
    with subprocess.Popen(
        [*_SOLVE, *options],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "BROWSER": follow, "TMPDIR": scratch},
        start_new_session=True,
    ) as process:
        if process.stdout is None:
            raise FailedError("there is no output")
        result = process.stdout.readline()
        took = time.perf_counter() - began
        process.send_signal(signal.SIGINT)
    if stopped:
        os.kill(int(Path(scratch, STOPPED).read_text()), signal.SIGKILL)
    found = re.search(rb'"wall_s": ?([0-9.]+)', result)
    messages = sum(map(int, re.findall(rb'"(?:Ok|Nogood|AddLink)": ?([0-9]+)', result)))
    if not (found and messages):
        raise FailedError(f"no result: {result[:200]!r}")
    return took, float(found[1]) / messages


def _first(scratch: Path) -> list[Row]:
    """How soon there is what for a journal of so many messages."""
    say("a long journal")
    journal = scratch / "long.journal"
    subprocess.run([sys.executable, _PAGE, str(journal), "write", str(MESSAGES)], check=True)
    rows: list[Row] = [("until", "s")]
    began = time.perf_counter()
    with _sniffing(journal) as url:
        rows.append(("the URL is told", f"{time.perf_counter() - began:.1f}"))
        timing = subprocess.run([sys.executable, _PAGE, url, "time"], check=True, capture_output=True, text=True)
    until_url = float(rows[-1][1])
    for line in timing.stdout.splitlines():
        what, _, seconds = line.rpartition(" ")
        rows.append((what, f"{until_url + float(seconds):.1f}"))
    rows.append(("size of the journal, bytes a message", f"{journal.stat().st_size / MESSAGES:.1f}"))
    return rows


@contextmanager
def _sniffing(journal: Path) -> Iterator[str]:
    with subprocess.Popen([ROBOCHOC, "sniff", str(journal)], stderr=subprocess.PIPE, text=True) as process:
        try:
            if process.stderr is None:
                raise FailedError("there is no URL")
            yield process.stderr.readline().split()[0]
        finally:
            process.send_signal(signal.SIGINT)
