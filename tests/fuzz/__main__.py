"""`make fuzz`: all targets, one after the other, each in a process of its own.

With `atheris` installed (`pip install 'robochoc[fuzz]'`) inputs that reach new code are mutated further; without it,
or with `--engine loop`, each input is made of a valid one, the seed and its number: the same seed, the same inputs.
"""

from __future__ import annotations

import argparse
import os
import secrets
import subprocess
import sys
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path
from random import Random

from tests.fuzz.harness import CPU_S, Findings, Target, spoilt, tried
from tests.fuzz.mutations import LARGEST

GRACE_S = 120
"""So long may a process take to end once its time is over."""
RSS_MB = 4096
"""A process with more memory than that is ended."""


def main() -> int:
    """Run the command line; 1: something was found."""
    parser = argparse.ArgumentParser(prog="fuzz", description="Give spoilt inputs to all that reads them.")
    parser.add_argument("files", nargs="*", type=Path, help="inputs to be tried again (with --target)")
    parser.add_argument("--seconds", type=float, default=60, help="for all targets together [60]")
    parser.add_argument("--seed", type=int, help="repeats a run of the loop [drawn]")
    parser.add_argument("--target", action="append", help="only this one")
    parser.add_argument("--engine", choices=("atheris", "loop"), help="[atheris, if it is installed]")
    parser.add_argument("--out", type=Path, default=Path("out/fuzz"), help="folder for what is found [out/fuzz]")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.seed is None:
        options.seed = secrets.randbelow(10**6)
    options.engine = options.engine or ("atheris" if find_spec("atheris") else "loop")
    if options.inside:
        (_guided if options.engine == "atheris" else _loop)(options)
        return 0
    if options.files:
        return _again(options)
    return _all(options)


def _named(names: list[str] | None) -> list[Target]:
    from tests.fuzz.file_targets import TARGETS as FILES  # noqa: PLC0415 - atheris wants to see them come
    from tests.fuzz.foreign_targets import TARGETS as FOREIGN  # noqa: PLC0415 - the same
    from tests.fuzz.mavlink_target import TARGETS as MAVLINK  # noqa: PLC0415 - the same
    from tests.fuzz.rmf_targets import TARGETS as RMF  # noqa: PLC0415 - the same
    from tests.fuzz.robot_targets import TARGETS as ROBOTS  # noqa: PLC0415 - the same
    from tests.fuzz.wire_targets import TARGETS as WIRE  # noqa: PLC0415 - the same

    targets = {target.name: target for target in (*FILES, *FOREIGN, *MAVLINK, *RMF, *ROBOTS, *WIRE)}
    unknown = set(names or ()) - targets.keys()
    if unknown:
        raise SystemExit(f"fuzz: there is no target {min(unknown)}; there are {', '.join(targets)}")
    return [target for name, target in targets.items() if not names or name in names]


def _all(options: argparse.Namespace) -> int:
    """Each target in a process, which may die of what it reads."""
    targets = _named(options.target)
    sys.stdout.write(
        f"seed {options.seed}, {options.engine}: make fuzz SEED={options.seed} SECONDS={options.seconds:g}"
        f" ENGINE={options.engine}\n"
    )
    found = [_apart(options, target, options.seconds / len(targets)) for target in targets]
    return int(any(found))


def _apart(options: argparse.Namespace, target: Target, seconds: float) -> bool:
    """Whether anything is found when `target` is tried in a process of its own."""
    words = ["--target", target.name, "--seconds", f"{seconds:g}", "--seed", str(options.seed)]
    words += ["--engine", options.engine, "--out", str(options.out), "--inside"]
    options.out.mkdir(parents=True, exist_ok=True)
    began = time.time()
    with (options.out / f"{target.name}.log").open("w") as log, tempfile.TemporaryDirectory(prefix="fuzz-") as cache:
        environment = {**os.environ, "XDG_CACHE_HOME": cache, "TMPDIR": cache}
        command = [sys.executable, "-m", "tests.fuzz", *words]
        try:
            done = subprocess.run(
                command, env=environment, stderr=log, check=False, timeout=seconds + GRACE_S
            ).returncode
        except subprocess.TimeoutExpired:
            done = -1
    dead = _current(options.out, target).exists()
    if dead:
        sys.stdout.write(
            f"{target.name}: it died or hung ({done}) with {_current(options.out, target)}; see {log.name}\n"
        )
    return dead or any(path.stat().st_mtime >= began for path in options.out.glob(f"{target.name}-*.txt"))


def _current(out: Path, target: Target) -> Path:
    """Where the input is kept that is being tried."""
    return out / f"{target.name}.current"


def _again(options: argparse.Namespace) -> int:
    """Try files once more, and show what comes out."""
    (target,) = _named(options.target)
    for file in options.files:
        sys.stdout.write(f"{file}: {'accepted' if target.check(file.read_bytes()) else 'refused'}\n")
    return 0


class _Attempts:
    """Inputs of one target, what they came to, and the one that is being tried, in a file."""

    def __init__(self, target: Target, out: Path) -> None:
        out.mkdir(parents=True, exist_ok=True)
        self.target = target
        self.count = self.accepted = self.found = 0
        self._findings = Findings(out, target.name)
        self._current = _current(out, target).open("wb")

    def attempt(self, content: bytes, number: int | None = None) -> None:
        """Try one more."""
        self._current.seek(0)
        self._current.truncate()
        self._current.write(content)
        self._current.flush()
        accepted, error = tried(self.target, content)
        self.count += 1
        self.accepted += accepted
        if error is None:
            return
        path = self._findings.note(content, error)
        if path:
            self.found += 1
            which = "" if number is None else f" (input {number})"
            told = f"{self.target.name}: {type(error).__name__}: {str(error)[:200]!a}{which}: {path}\n"
            sys.stdout.write(told)
            sys.stdout.flush()

    def close(self) -> None:
        """Say what it came to."""
        self._current.close()
        Path(self._current.name).unlink()
        sys.stdout.write(
            f"{self.target.name}: {self.count:,} inputs, {self.accepted:,} accepted, {self.found} kinds of findings\n"
        )
        sys.stdout.flush()


def _loop(options: argparse.Namespace) -> None:
    (target,) = _named(options.target)
    attempts = _Attempts(target, options.out)
    corpus = target.corpus()
    for content in corpus:
        attempts.attempt(content)
    until = time.monotonic() + options.seconds
    number = 0
    while time.monotonic() < until:
        attempts.attempt(spoilt(target, corpus, options.seed, number), number)
        number += 1
    attempts.close()


def _guided(options: argparse.Namespace) -> None:
    """The same, guided by what code inputs reach."""
    import atheris  # noqa: PLC0415 - an extra

    with atheris.instrument_imports(include=["robochoc"]):
        (target,) = _named(options.target)
    attempts = _Attempts(target, options.out)
    chance = Random(options.seed)
    until = time.monotonic() + options.seconds

    def attempt(content: bytes) -> None:
        attempts.attempt(content)
        if time.monotonic() > until:
            attempts.close()
            os._exit(0)  # libFuzzer would end the process as well, and leave no time to report

    def mutate(content: bytes, most: int, _seed: int) -> bytes:
        for _ in range(chance.choice((1, 1, 2))):  # libFuzzer asks for several in a row
            content = target.mutation(chance, content)
        return content[:most]

    corpus = Path(tempfile.mkdtemp())  # the parent removes it
    for number, content in enumerate(target.corpus()):
        (corpus / str(number)).write_bytes(content)
    limits = (f"-max_len={LARGEST}", f"-rss_limit_mb={RSS_MB}", f"-timeout={20 * CPU_S:.0f}", "-len_control=0")
    atheris.Setup(["fuzz", str(corpus), f"-seed={options.seed + 1}", *limits], attempt, custom_mutator=mutate)
    atheris.Fuzz()


if __name__ == "__main__":
    sys.exit(main())
