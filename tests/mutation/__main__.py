"""`make mutate`: mutants of all packages, drawn with a seed, each tried with the tests that reach the changed function.

All happens in a copy of the tree. A first run of the tests records the functions that each case calls; the record is
used again while it is there. Each survivor is either equivalent to the original, or a test is missing.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import secrets
import shutil
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from random import Random
from typing import Any

import pytest

from tests.mutation.chosen import FILE
from tests.mutation.limited import PYTEST, applied, limited
from tests.mutation.marks import FOLDER, prepare
from tests.mutation.mutants import Mutant, Place, mutants_of

ROOT = Path(__file__).parents[2]
FEWEST = 2
"""Mutants of the smallest package."""
CASES = 4
"""Cases of a parametrised test that a mutant meets."""
ROUNDS = ((8.0, 6), (60.0, 25))
"""CPU time in seconds, and files, of the tests of the first process for a mutant, and of the second one."""
LONGER = 4
"""A mutant hangs if its tests use this many times their CPU time."""
START_S = 30
NO_FAILURE = (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED)


@dataclass(frozen=True)
class Case:
    """A test case: its CPU time, the number of functions that it reaches, and whether it is one of `make test-more`."""

    name: str
    cpu_s: float
    reach: int
    more: bool = False

    @property
    def file(self) -> str:
        """The file of the test."""
        return self.name.partition("::")[0]

    @property
    def test(self) -> str:
        """The test without its parameters."""
        return self.name.partition("[")[0]


class Record:
    """The cases that reach each function."""

    def __init__(self, folder: Path) -> None:
        names = [tuple(name) for name in json.loads((folder / "functions.json").read_bytes())]
        self._cases = defaultdict[tuple[str, str], list[Case]](list)
        for file in folder.glob("cases-*.jsonl"):
            for line in map(json.loads, file.read_text().splitlines()):
                if line["passed"]:
                    case = Case(line["id"], line["cpu"], len(line["reached"]), line.get("more", False))
                    for name in {names[number] for number in line["reached"]}:
                        self._cases[name].append(case)

    def cases(self, *paths: str, function: str = "") -> list[Case]:
        """Return the cases that reach a function of the first path, nearest first; without one, those of all paths."""
        path = paths[0]
        near = [name for name in self._cases if name[0] in paths and function in {"", name[1]}]
        found = {case for name in near for case in self._cases[name]}
        package = Path(path).parts[1]
        homes = (f"tests/unit/{package}/", f"tests/{package}/")
        own = re.compile(rf"/test_{Path(path).stem}(_\w+)?\.py$")

        def distance(case: Case) -> tuple[bool, bool, int, float, str]:
            near = case.name.startswith(homes)
            return not (near and own.search(case.file)), not near, case.reach, case.cpu_s, case.name

        tried = Counter[str]()
        first, others = list[Case](), list[Case]()
        for case in sorted(found, key=distance):
            (first if tried[case.test] < CASES else others).append(case)
            tried[case.test] += 1
        return first + others


def rounds(cases: Sequence[Case]) -> Iterator[list[Case]]:
    """Share out cases to the processes that try a mutant, as far as their time goes."""
    left = list(cases)
    for cpu_s, most in ROUNDS:
        chosen, files, used = list[Case](), set[str](), 0.0
        for case in left:
            fits = used + case.cpu_s <= cpu_s or not chosen
            if fits and (case.file in files or len(files) < most):
                chosen.append(case)
                files.add(case.file)
                used += case.cpu_s
        if chosen:
            yield chosen
        left = [case for case in left if case not in set(chosen)]


def draw(tree: Path, files: Sequence[str], count: int, seed: int) -> list[Mutant]:
    """Draw mutants: from each package as many as its share of the lines, but a few from the smallest as well."""
    packages = defaultdict[str, dict[str, int]](dict)
    for path in sorted({str(path.relative_to(tree)) for pattern in files for path in tree.glob(pattern)}):
        packages["/".join(Path(path).parts[:-1][:2])][path] = (tree / path).read_bytes().count(b"\n")
    lines = {package: sum(sizes.values()) for package, sizes in packages.items()}
    exact = {package: count * size / sum(lines.values()) for package, size in lines.items()}
    shares = {package: max(FEWEST, round(share)) for package, share in exact.items()}
    while sum(shares.values()) > count and max(shares.values()) > FEWEST:
        shares[max(shares, key=lambda package: (shares[package] > FEWEST, shares[package] - exact[package]))] -= 1
    drawn = list[Mutant]()
    for package, sizes in packages.items():
        random, found = Random(f"{seed} {package}"), dict[str, Mutant]()
        for _ in range(100 * shares[package]):
            (path,) = random.choices(list(sizes), list(sizes.values()))
            if len(found) < shares[package] and (mutants := mutants_of(path, (tree / path).read_text())):
                mutant = random.choice(mutants)
                found[str(mutant)] = mutant
        drawn += found.values()
    Random(seed).shuffle(drawn)
    return drawn


class Bench:
    """A copy of the tree, in which mutants are tried one after the other."""

    def __init__(self, tree: Path, record: Record) -> None:
        self._tree = tree
        self._record = record

    def fate(self, mutant: Mutant, first: str = "") -> dict[str, Any]:
        """Try a mutant, with the cases of the test `first` before others."""
        cases = self._record.cases(mutant.path, function=mutant.place.function)
        if not (cases or mutant.place.function):  # a module without functions
            cases = self._record.cases(*importers(self._tree, mutant.path))
        cases = [case for case in cases if (self._tree / case.file).exists()]
        cases.sort(key=lambda case: case.test != first)
        result: dict[str, Any] = {"fate": "survived" if cases else "unreached", "reached_by": len(cases), "tried": 0}
        cpu_s = 0.0
        by_circle = ([case for case in cases if case.more == more] for more in (False, True))
        with applied(self._tree, mutant):
            for chosen in (chosen for part in by_circle for chosen in rounds(part)):
                failed, used = self._run(chosen)
                cpu_s += used
                result["tried"] += len(chosen)
                if failed:
                    result |= {**failed, "more": chosen[0].more}
                    break
        return {**result, "cpu_s": round(cpu_s, 1)}

    def _run(self, cases: Sequence[Case]) -> tuple[dict[str, Any], float]:
        """Run cases until the first one fails: return its name and error, and the CPU time of all."""
        chosen = self._tree / FOLDER / "chosen"
        failed = Path(f"{chosen}.failed")
        chosen.write_text(json.dumps([case.name for case in cases]))
        failed.unlink(missing_ok=True)
        files = list(dict.fromkeys(case.file for case in cases))
        limit_s = int(START_S + LONGER * sum(case.cpu_s for case in cases))
        words = (*PYTEST, "-m", "", "-x", "-p", "tests.mutation.chosen", *files)
        code, used, output = limited(self._tree, words, limit_s, {FILE: str(chosen)})
        if code in NO_FAILURE:
            return {}, used
        by, error = json.loads(failed.read_text()) if failed.exists() else ("", output[-300:])
        hung = code < 0 or "Timeout (" in error
        return {"fate": "hung" if hung else "killed", "by": by, "error": error, "code": code}, used


def copy(source: Path, target: Path) -> None:
    """Copy a tree, and these tools into it."""
    left_out = shutil.ignore_patterns(".git", ".venv", ".*cache", "out", "__pycache__")
    shutil.copytree(source, target, ignore=left_out, symlinks=True)
    shutil.copytree(Path(__file__).parent, target / "tests" / "mutation", dirs_exist_ok=True)


def importers(tree: Path, path: str) -> list[str]:
    """Return `path`, and the files of the program that import from it."""
    line = f"from {path.removesuffix('.py').removesuffix('/__init__').replace('/', '.')} import"
    files = (file for file in tree.glob("robochoc/**/*.py") if line in file.read_text())
    return [path, *sorted(str(file.relative_to(tree)) for file in files)]


def compile_all(tree: Path) -> None:
    """Let Python store compiled files of everything, since a run with a mutant stores none."""
    command = [sys.executable, "-m", "pytest", "-q", "--collect-only", "tests"]
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    subprocess.run(command, cwd=tree, env=environment, stdout=subprocess.DEVNULL, check=False)


def record(source: Path, folder: Path, jobs: int) -> None:
    """Run the tests in a copy of the tree, and write the functions that they reach into `folder`."""
    with tempfile.TemporaryDirectory(prefix="mutate-") as place:
        tree = Path(place, "tree")
        copy(source, tree)
        functions = prepare(tree)
        workers = ("-n", str(jobs), "--dist", "loadfile")
        command = [sys.executable, "-m", "pytest", "-q", "-m", "not slow", "-p", "tests.mutation.record", *workers]
        subprocess.run(command, cwd=tree, env={**os.environ, "PYTHONPATH": str(tree)}, check=False)
        folder.mkdir(parents=True)
        (folder / "functions.json").write_text(json.dumps(functions))
        for file in (tree / FOLDER).glob("cases-*.jsonl"):
            shutil.copy(file, folder)


def again(tree: Path, lines: Iterable[str]) -> Iterator[tuple[Mutant | None, dict[str, Any]]]:
    """Find the mutants of earlier results in a tree: None for one that has no place there."""
    for line in map(json.loads, lines):
        place = Place(*line["place"])
        file = tree / place.path
        mutants = mutants_of(place.path, file.read_text()) if file.exists() else []
        yield next((mutant for mutant in mutants if mutant.place == place), None), line


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line. The tests must pass without mutants."""
    parser = argparse.ArgumentParser(prog="mutate", description="Change code, and look whether tests notice.")
    parser.add_argument("files", nargs="*", default=["robochoc/**/*.py"], help="files to change [robochoc/**/*.py]")
    parser.add_argument("--count", type=int, default=100, help="mutants to draw [100]")
    parser.add_argument("--seed", type=int, help="repeats a draw [drawn]")
    parser.add_argument(
        "--again", type=Path, metavar="RESULTS", help="the mutants of these results, in place of a draw"
    )
    parser.add_argument("--tree", type=Path, default=ROOT, help="the tree to change a copy of [this one]")
    parser.add_argument("--record", type=Path, default=ROOT / "out/mutation/record", help="the record, made if missing")
    parser.add_argument("--results", type=Path, default=ROOT / "out/mutation/results.jsonl", help="a line a mutant")
    parser.add_argument("--jobs", type=int, default=2, help="tests that run at the same time [2]")
    options = parser.parse_args(words)
    options.results.parent.mkdir(parents=True, exist_ok=True)
    if options.again:
        work = list(again(options.tree, options.again.read_text().splitlines()))
    else:
        seed = secrets.randbelow(10**6) if options.seed is None else options.seed
        _say(f"seed {seed}")
        work = [(mutant, {}) for mutant in draw(options.tree, options.files, options.count, seed)]
    if not options.record.exists():
        record(options.tree, options.record, options.jobs)
    fates = Counter[str]()
    with tempfile.TemporaryDirectory(prefix="mutate-") as folder, options.results.open("a") as results:
        trees = [Path(folder, str(job)) for job in range(options.jobs)]
        copy(options.tree, trees[0])
        (trees[0] / FOLDER).mkdir()
        compile_all(trees[0])
        benches, known = SimpleQueue[Bench](), Record(options.record)
        for tree in trees:
            if tree != trees[0]:
                shutil.copytree(trees[0], tree, symlinks=True)
            benches.put(Bench(tree, known))

        def attempt(pair: tuple[Mutant | None, dict[str, Any]]) -> dict[str, Any]:
            mutant, earlier = pair
            if mutant is None:
                return {"place": earlier["place"], "was": earlier.get("fate"), "fate": "not found"}
            bench = benches.get()
            result = bench.fate(mutant, earlier.get("by", "").partition("[")[0])
            benches.put(bench)
            return {"place": mutant.place, "id": str(mutant), "was": earlier.get("fate"), **result, "diff": mutant.diff}

        with ThreadPoolExecutor(options.jobs) as pool:
            for result in pool.map(attempt, work):
                fates[result["fate"]] += 1
                results.write(json.dumps(result) + "\n")
                results.flush()
                _say(f"{result['fate']} {result.get('id') or result['place']} {result.get('by', '')}")
                if result["fate"] in {"survived", "unreached"}:
                    _say(result["diff"])
    _say(", ".join(f"{number} {fate}" for fate, number in fates.items()))
    return 0


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
