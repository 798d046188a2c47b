"""`make mutate`: so many mutants, drawn with a seed, each run against the tests that should notice it.

The mutants live in a copy of the tree. Those that survive are shown: each is either equivalent to what it was made
from, or a test is missing. `python -m tests.mutation --again PATH:NUMBER` tries one again.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import resource
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from random import Random

import pytest

from tests.mutation.mutants import Mutant, mutants_of

ROOT = Path(__file__).parents[2]
FILES = (
    "robochoc/protocols/**/*.py",
    "robochoc/communication/quiescence.py",
    "robochoc/communication/host.py",
    "robochoc/communication/search_state.py",
    "robochoc/verification/*.py",
)
SHARED = {
    "communication": (
        "tests/network/test_search_state.py",
        "tests/unit/communication/test_simulator.py",
        "tests/unit/replay/test_replay.py",
    ),
    "verification": ("tests/unit/run", "tests/unit/solver/test_central_costs.py"),
}
"""More tests of what is no protocol."""
SENTENCES = "tests/unit/sniffer/test_sentences.py"
"""What protocols say, in words."""
OWN_CPU_S, CPU_S = 30, 300
"""A mutant hangs once the tests of its own file have used so many seconds of CPU time, or all others."""
HANG_S = 900
"""So long may it wait without using the CPU."""
MEMORY = 4 << 30
UNNOTICED = (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED)


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line. The tests must pass as they are: `make test` before."""
    parser = argparse.ArgumentParser(prog="mutate", description="Spoil code, and look whether tests notice.")
    parser.add_argument("files", nargs="*", help=f"files to mutate [{' '.join(FILES)}]")
    parser.add_argument("--count", type=int, default=100, help="mutants to draw [100]")
    parser.add_argument("--seed", type=int, help="repeats a draw [drawn]")
    parser.add_argument("--again", action="append", metavar="PATH:NUMBER", help="only this mutant")
    options = parser.parse_args(words)
    paths = sorted(str(path.relative_to(ROOT)) for files in options.files or FILES for path in ROOT.glob(files))
    drawn = [mutant for path in paths for mutant in mutants_of(path, (ROOT / path).read_text())]
    if options.again:
        drawn = [mutant for mutant in drawn if str(mutant) in options.again]
    else:
        seed = secrets.randbelow(10**6) if options.seed is None else options.seed
        _say(f"seed {seed}: {min(options.count, len(drawn))} of {len(drawn):,} mutants")
        drawn = Random(seed).sample(drawn, min(options.count, len(drawn)))
    with tempfile.TemporaryDirectory(prefix="mutate-") as folder:
        tree = Path(folder, "tree")
        shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns(".*", "out"))
        bench = _Bench(tree)
        fates = Counter(bench.fate(mutant) for mutant in drawn)
    _say(", ".join(f"{fates[fate]} {fate}" for fate in ("killed", "hung", "survived")))
    return 0


class _Bench:
    """A copy of the tree, in which mutants are tried one after the other."""

    def __init__(self, tree: Path) -> None:
        self._tree = tree

    def fate(self, mutant: Mutant) -> str:
        """Return whether `mutant` was killed, hung, or survived, and say so."""
        file = self._tree / mutant.path
        as_it_was = file.stat()
        file.write_text(mutant.text)
        codes = (self._run(tests, cpu_s) for tests, cpu_s in commands_for(mutant.path))
        code = next((code for code in codes if code not in UNNOTICED), 0)
        file.write_text(mutant.source)
        os.utime(file, ns=(as_it_was.st_atime_ns, as_it_was.st_mtime_ns))
        fate = "hung" if code < 0 else "killed" if code else "survived"
        _say(f"{fate} {mutant}" + (f"\n{mutant.diff}" if fate == "survived" else ""))
        return fate

    def _run(self, tests: Sequence[str], cpu_s: int) -> int:
        """Run tests until the first one fails; return the exit code, negative when they were stopped."""

        def limit() -> None:
            resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s))
            resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))

        command = [sys.executable, "-m", "pytest", "-x", "-q", "--no-header", "-p", "no:cacheprovider", *tests]
        run = subprocess.Popen(
            command,
            cwd=self._tree,
            env={**os.environ, "PYTHONPATH": str(self._tree), "PYTHONDONTWRITEBYTECODE": "1"},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            preexec_fn=limit,  # noqa: PLW1509 - nothing here has threads
        )
        try:
            return run.wait(HANG_S)
        except subprocess.TimeoutExpired:
            return -signal.SIGKILL
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(run.pid, signal.SIGKILL)
            run.wait()


def commands_for(path: str) -> Iterator[tuple[tuple[str, ...], int]]:
    """Yield what pytest runs for a mutant of this file: its own tests, then those that run more of the program.

    With each, the CPU time that it may take.
    """
    stem = Path(path).stem
    own = sorted(ROOT.glob(f"tests/*/**/test_{stem}.py")) + sorted(ROOT.glob(f"tests/*/**/test_{stem}_*.py"))
    if own:
        yield tuple(str(file.relative_to(ROOT)) for file in own), OWN_CPU_S
    room = Path(path).parent.name
    if room in SHARED:
        yield SHARED[room], CPU_S
        yield ("tests/conformance", "-k", "abt or syncbb"), CPU_S
        return
    users = _users(_module(Path(path)))
    others = [file for file in sorted(ROOT.glob("tests/protocols/test_*.py")) if users & _imported(file)]
    yield (SENTENCES, *(str(file.relative_to(ROOT)) for file in others if file not in own)), CPU_S
    points = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]["robochoc.protocols"]
    names = [name for name, place in points.items() if place.partition(":")[0] in users]
    yield ("tests/conformance", "-k", " or ".join(names)), CPU_S


def _users(module: str) -> set[str]:
    """Return the modules of protocols that import `module`, and it, and those that import them."""
    files = ROOT.glob("robochoc/protocols/**/*.py")
    imports = {_module(file.relative_to(ROOT)): _imported(file) for file in files}
    users = {module}
    while more := {user for user, imported in imports.items() if imported & users} - users:
        users |= more
    return users


def _imported(file: Path) -> set[str]:
    return set(re.findall(r"^\s*from (robochoc\.protocols\.[\w.]+) import", file.read_text(), re.MULTILINE))


def _module(path: Path) -> str:
    return ".".join(path.with_suffix("").parts)


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
