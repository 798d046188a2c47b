"""Part `journal`: how large journals are, how fast they are written and read, and what they cost a run."""

from __future__ import annotations

import gc
import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from measure import ROBOCHOC, RUNS, Sample, say, spread, timed_command
from report import Row, Section

from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import AnyEvent, Sent
from robochoc.journal.journal import Header, JournalFile, JournalRecorder, lines_of, read_journal
from robochoc.run import Options, Runtime, solve

MESSAGES = 1_000_000
PAIRS = 2 * RUNS
"""Of runs without and with a journal, in turn."""
MICRO = 1e6


def measured() -> Section:
    """A million messages, and ABT on n = 7 with and without."""
    notes = (
        f"First table: ABT on queens3d n = 8 in the simulator, stopped after {MESSAGES:,} messages; its events, kept "
        "in memory, are told to a recorder that writes a file, and the file is read, with the clock running. `as "
        "text` is the same journal as JSON lines. Second table: whole commands, `robochoc solve FOLDER --json` on "
        f"queens3d n = 7 full, {PAIRS} times without and with `--journal FILE`, in turn; ratios are of the medians. "
        "In processes the number of messages depends on which robot gets the processor when, so the ratio of what a "
        "message costs is the one to look at. Median (min..max)."
    )
    return Section("journal", "The journal", notes, (_million(), _overhead()))


def _million() -> list[Row]:
    say(f"{MESSAGES:,} messages")
    events: list[AnyEvent] = []
    team = queens3d(8)
    solve(team, Options(runtime=Runtime.SIMULATOR, messages=MESSAGES), observer=events.append)
    gc.collect()
    gc.freeze()  # what is measured are journals, not the collector looking at these events
    sent = sum(isinstance(event, Sent) for event in events)
    header = Header(team=team.name, protocol="abt", runtime="simulator", seed=0)
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "run.journal"
        say("writing it")
        writing = [_seconds(lambda: _write(header, events, path)) / sent * MICRO for _ in range(RUNS)]
        content = path.read_bytes()
    say("reading it")
    reading = [_seconds(lambda: read_journal(content)) / sent * MICRO for _ in range(RUNS)]
    text = b"".join(lines_of(read_journal(content)))
    say("reading it as text")
    reading_text = [_seconds(lambda: read_journal(text)) / sent * MICRO for _ in range(RUNS)]
    head = ("", "entries", "MB", "bytes a message", "µs a message, writing", "µs a message, reading")
    count = f"{len(events):,}"
    return [
        head,
        ("journal", count, *_size(content, sent), spread(writing), spread(reading)),
        ("as text", count, *_size(text, sent), "", spread(reading_text)),
    ]


def _size(content: bytes, sent: int) -> tuple[str, str]:
    return f"{len(content) / MICRO:.1f}", f"{len(content) / sent:.1f}"


def _write(header: Header, events: Sequence[AnyEvent], path: Path) -> None:
    file = JournalFile(path)
    recorder = JournalRecorder(header, sinks=[file.write])
    for event in events:
        recorder(event)
    recorder.close()
    file.close()


def _seconds(act: Callable[[], object]) -> float:
    began = time.perf_counter()
    act()
    return time.perf_counter() - began


def _overhead() -> list[Row]:
    head = ("runtime", "journal", "wall s", "CPU s", "messages", "CPU µs a message", "MB")
    rows: list[Row] = [head]
    with tempfile.TemporaryDirectory() as scratch:
        folder, path = Path(scratch) / "queens3d-7", Path(scratch) / "run.journal"
        write_team(queens3d(7, "full"), folder)
        for runtime in ("processes", "simulator"):
            rows += _pairs(runtime, folder, path)
    return rows


def _pairs(runtime: str, folder: Path, path: Path) -> list[Row]:
    say(f"queens3d n = 7 full, {runtime}, without and with")
    plain = [ROBOCHOC, "solve", str(folder), "--json", "--runtime", runtime]
    without, kept = [], []
    for _ in range(PAIRS):
        without.append(timed_command(plain))
        kept.append(timed_command([*plain, "--journal", str(path)]))
    size = f"{path.stat().st_size / MICRO:.2f}"
    columns = [[_figures(sample) for sample in samples] for samples in (without, kept)]
    rows: list[Row] = []
    for word, figures, last in zip(("without", "with"), columns, ("", size), strict=True):
        wall, cpu, messages, each = zip(*figures, strict=True)
        rows.append((runtime, word, spread(wall), spread(cpu), spread(messages, 0), spread(each, 1), last))
    medians = [[statistics.median(column) for column in zip(*figures, strict=True)] for figures in columns]
    ratios = [f"{after / before:.2f}" for before, after in zip(*medians, strict=True)]
    return [*rows, (runtime, "ratio", *ratios, "")]


def _figures(sample: Sample) -> tuple[float, float, float, float]:
    """Wall and CPU seconds, messages, and CPU microseconds a message."""
    result: dict[str, Any] = sample.answer
    messages = result["metrics"]["messages"]
    return sample.wall_s, sample.cpu_s, messages, sample.cpu_s / messages * MICRO
