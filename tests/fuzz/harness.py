"""What holds of every input, whatever it is: it may take so much time and memory, and tells of itself in clear text."""

from __future__ import annotations

import hashlib
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from types import FrameType

from tests.fuzz.mutations import Mutation

CPU_S = 5.0
"""Seconds of CPU time that one input may take."""
MEMORY = 512 << 20
"""Bytes by which one input may raise the most memory that the process has had."""
STACKED = 6
"""Mutations of one input, at most."""


@dataclass(frozen=True)
class Target:
    """Something that reads: `check` takes an input, and returns whether it was accepted.

    It lets only such exceptions out as are findings. `corpus` makes valid inputs, `mutation` spoils them.
    """

    name: str
    corpus: Callable[[], Sequence[bytes]]
    mutation: Mutation
    check: Callable[[bytes], bool]


class TooDearError(Exception):
    """An input took too much time or memory."""


def assert_clear(text: str) -> None:
    """Raise `AssertionError` where `text` is not clear: lines of what can be printed."""
    lines = text.split("\n")
    assert all(line.isprintable() for line in lines), f"unprintable: {text[:300]!r}"
    assert len(text) < 1 << 18, f"{len(text):,} characters: {text[:100]!r}"
    assert text.strip(), "nothing is said"


def assert_said(refusal: Exception) -> None:
    """Raise `AssertionError` where a refusal says nothing, or too much. Whoever shows it makes it clear."""
    assert 0 < len(str(refusal)) < 1 << 18, repr(refusal)[:300]


class Findings:
    """What was found; inputs and tracebacks are kept in `folder`, of each kind the first."""

    def __init__(self, folder: Path, target: str) -> None:
        self._folder = folder
        self._target = target
        self._kinds: set[str] = set()

    def note(self, content: bytes, error: BaseException) -> Path | None:
        """Keep the input `content`, on which `error` came out; None: one of the kind is known."""
        kind = _kind(error)
        if kind in self._kinds:
            return None
        self._kinds.add(kind)
        name = f"{self._target}-{hashlib.sha256(content).hexdigest()[:12]}"
        self._folder.mkdir(parents=True, exist_ok=True)
        path = self._folder / name
        path.write_bytes(content)
        told = "".join(traceback.format_exception(error))
        path.with_suffix(".txt").write_text(told, errors="backslashreplace")
        return path


def _kind(error: BaseException) -> str:
    """Where in robochoc it came from, and what it is."""
    frames = traceback.extract_tb(error.__traceback__)
    place = next((frame for frame in reversed(frames) if "/robochoc/" in frame.filename), frames[-1])
    words = str(error)[:40] if isinstance(error, AssertionError) else ""
    return f"{type(error).__name__} {place.filename}:{place.lineno} {words}"


def tried(target: Target, content: bytes) -> tuple[bool, BaseException | None]:
    """Whether `target` accepts `content`; and what came out that should not have."""
    before = _peak()
    began = time.process_time()
    accepted, found = False, None
    try:
        with _limited():
            accepted = target.check(content)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001 - all else is what is looked for
        found = error
    spent, grown = time.process_time() - began, _peak() - before
    if found is None and spent > CPU_S:
        found = TooDearError(f"{spent:.1f} s of CPU time")
    if found is None and grown > MEMORY:
        found = TooDearError(f"{grown >> 20} MiB more memory than any input before")
    return accepted, found


@contextmanager
def _limited() -> Iterator[None]:
    """Raise `TooDearError` when the time is over: in Python soon, in a library once it comes back."""

    def over(_signum: int, _frame: FrameType | None) -> None:
        raise TooDearError(f"more than {2 * CPU_S:g} s of CPU time")

    before = signal.signal(signal.SIGPROF, over)
    signal.setitimer(signal.ITIMER_PROF, 2 * CPU_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def _peak() -> int:
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


def spoilt(target: Target, corpus: Sequence[bytes], seed: int, number: int) -> bytes:
    """Input `number` of `target` with `seed`: always the same."""
    chance = Random(f"{seed} {target.name} {number}")
    content = chance.choice(corpus)
    for _ in range(chance.randrange(STACKED + 1)):
        content = target.mutation(chance, content)
    return content
