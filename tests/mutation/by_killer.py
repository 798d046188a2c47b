"""`make mutate BY_KILLER=1`: which kind of test detects which mutant.

The mutants are drawn from the protocols, the hosts, and the detection of the end of a search. Each killer is tried on
each mutant, with limited CPU time: `check` explores the orders of messages among robots, `every order` those between
robots and master, `simulate` plays random runs with faults, and `conformance`, `golden` and `unit` are tests. A run
continues where an earlier one has stopped: results are lines of JSON, one for each mutant and killer.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from pathlib import Path
from queue import SimpleQueue
from typing import Any, NamedTuple

import grimp
import pytest

from robochoc.run.registry import protocol_named, protocol_names
from tests.mutation.__main__ import ROOT, compile_all, copy, draw
from tests.mutation.limited import PYTEST, applied, limited
from tests.mutation.mutants import Mutant, Place
from tests.support.quick import touched

AREAS: Mapping[str, tuple[int, tuple[str, ...]]] = {
    "protocols": (70, ("robochoc/protocols/**/*.py",)),
    "hosts": (15, ("robochoc/communication/host.py", "robochoc/communication/session.py")),
    "quiescence": (
        15,
        (
            "robochoc/communication/quiescence.py",
            "robochoc/communication/search_state.py",
            "robochoc/communication/search_watch.py",
        ),
    ),
}
"""The percentage of mutants from each area, and its files."""
NOT_RUN = re.compile(r"(^$|\bproves$|_proves$|\bproof|in_words|_text$|^_shown$|^_current_values$)")
"""Functions that no search calls: the wording of messages, and the analysis of what they disclose."""
ANY = ("abt", "afc-ng", "adopt", "dpop")
"""The protocols with which mutants outside protocols are tried."""
MOST_PROTOCOLS = 3
MOST_FILES = 5
"""The maximum numbers of protocols and of unit tests' files that a mutant meets."""
SURVIVED, KILLED, HUNG, NONE = "survived", "killed", "hung", "no test"
EXPLORED = (0, 3)
"""Exit codes of `robochoc check` without a fault."""
PASSED = (int(pytest.ExitCode.OK), int(pytest.ExitCode.NO_TESTS_COLLECTED))


class Target(NamedTuple):
    """The nearest protocols that use the file of a mutant, and the nearest files of unit tests."""

    protocols: tuple[str, ...]
    files: tuple[str, ...]


class Uses:
    """The protocols and tests that use each file of a tree, nearest first, by imports."""

    def __init__(self, tree: Path) -> None:
        self.tree = tree
        self._graph = grimp.build_graph("robochoc", "tests", cache_dir=None)

    def target(self, path: str) -> Target:
        """Return what mutants of the file at `path` meet."""
        module = path.removesuffix(".py").replace("/", ".")
        return Target(tuple(self._protocols(module)[:MOST_PROTOCOLS]) or ANY, tuple(self._files(module)[:MOST_FILES]))

    def _protocols(self, module: str) -> list[str]:
        if not module.startswith("robochoc.protocols."):
            return []
        chains = {
            name: self._graph.find_shortest_chain(protocol_named(name).__module__, module)
            for name in protocol_names()
            if protocol_named(name).__module__ != module
        }
        own = [name for name in protocol_names() if name not in chains]
        return own + sorted((name for name, chain in chains.items() if chain), key=lambda name: len(chains[name] or ()))

    def _files(self, module: str) -> list[str]:
        files = [f"{test.replace('.', '/')}.py" for test in touched(self._graph, [module])]
        own = f"test_{module.rpartition('.')[2]}"
        found = [file for file in files if file.startswith(("tests/protocols/", "tests/unit/"))]
        return sorted(found, key=lambda file: not Path(file).stem.startswith(own))

    @cached_property
    def conformance(self) -> Mapping[str, list[str]]:
        """The cases in `tests/conformance` by protocol."""
        words = (*PYTEST, "--collect-only", "tests/conformance")
        found = defaultdict[str, list[str]](list)
        for line in limited(self.tree, words, 600)[2].splitlines():
            parameters = re.search(r"\[(.+)\]$", line)
            if line.startswith("tests/") and parameters:
                named = [name for name in protocol_names() if re.search(rf"(?<!\w){name}(?!\w)", parameters[1])]
                if named:
                    found[max(named, key=len)].append(line)
        return found


class Killer(NamedTuple):
    """A way to detect mutants: commands of Python, the exit codes without a detection, and a limit of the CPU time."""

    name: str
    commands: Callable[[Uses, Target], Iterator[Sequence[str]]]
    undetected: tuple[int, ...]
    cpu_s: int


def _check(_: Uses, target: Target) -> Iterator[Sequence[str]]:
    for protocol in target.protocols:
        yield ("-m", "robochoc", "check", protocol, "--teams", "25", "--states", "800", "--jobs", "1", "--json")


def _every_order(_: Uses, target: Target) -> Iterator[Sequence[str]]:
    if target.protocols == ANY:
        yield (*PYTEST, "-x", "tests/unit/communication/test_every_order.py")
    else:
        yield ("-m", "tests.mutation.every_order", *target.protocols)


def _simulate(_: Uses, target: Target) -> Iterator[Sequence[str]]:
    yield ("-m", "tests.mutation.simulated", *target.protocols)


def _conformance(uses: Uses, target: Target) -> Iterator[Sequence[str]]:
    yield (*PYTEST, "-x", *(case for protocol in target.protocols for case in uses.conformance[protocol]))


def _golden(_: Uses, target: Target) -> Iterator[Sequence[str]]:
    test = "tests/unit/communication/test_simulator.py::test_journals_are_as_they_were"
    yield (*PYTEST, "-x", *(f"{test}[{protocol}]" for protocol in target.protocols))


def _unit(_: Uses, target: Target) -> Iterator[Sequence[str]]:
    if target.files:
        yield (*PYTEST, "-x", *target.files)


KILLERS = (
    Killer("check", _check, EXPLORED, 60),
    Killer("every order", _every_order, PASSED, 90),
    Killer("simulate", _simulate, (0,), 60),
    Killer("conformance", _conformance, PASSED, 60),
    Killer("golden", _golden, PASSED, 60),
    Killer("unit", _unit, PASSED, 90),
)


def attempt(uses: Uses, tree: Path, mutant: Mutant, killer: Killer) -> dict[str, Any]:
    """Try a mutant with a killer in `tree`; return the fate, the error, and the CPU time."""
    commands = list(killer.commands(uses, uses.target(mutant.path)))
    result: dict[str, Any] = {"fate": SURVIVED if commands else NONE}
    cpu_s = 0.0
    with applied(tree, mutant):
        for words in commands:
            code, used, output = limited(tree, words, killer.cpu_s)
            cpu_s += used
            if code not in killer.undetected:
                result = {"fate": HUNG if code < 0 else KILLED, "code": code, "error": output[-300:]}
                break
    return {**result, "cpu_s": round(cpu_s, 1)}


def drawn(tree: Path, count: int, seed: int) -> list[Mutant]:
    """Draw mutants from the areas, all of functions that searches call."""
    found = list[Mutant]()
    for percentage, files in AREAS.values():
        wanted = round(count * percentage / 100)
        candidates = draw(tree, files, 3 * wanted, seed)
        found += [one for one in candidates if not NOT_RUN.search(one.place.function.rpartition(".")[2])][:wanted]
    return found


def area_of(path: str) -> str:
    """Return the area of a file."""
    return next((area for area, (_, files) in AREAS.items() if path in files), "protocols")


def table(lines: Iterable[Mapping[str, Any]]) -> str:
    """Return the numbers of detected mutants by area and killer, as a Markdown table, and the survivors."""
    by_mutant = defaultdict[Place, dict[str, str]](dict)
    for line in lines:
        by_mutant[Place(*line["place"])][line["killer"]] = line["fate"]
    rows = ["| killer | " + " | ".join(AREAS) + " | all | alone |", "| --- |" + " ---: |" * (len(AREAS) + 2)]
    for killer in KILLERS:
        tried, detected, alone = Counter[str](), Counter[str](), 0
        for mutant, fates in by_mutant.items():
            area, fate = area_of(mutant.path), fates.get(killer.name, NONE)
            tried[area] += fate != NONE
            detected[area] += fate in {KILLED, HUNG}
            alone += [name for name, one in fates.items() if one in {KILLED, HUNG}] == [killer.name]
        cells = [f"{detected[area]} of {tried[area]}" for area in AREAS]
        rows.append(f"| {killer.name} | {' | '.join(cells)} | {detected.total()} of {tried.total()} | {alone} |")
    left = [
        f"{mutant.path} {mutant.function}: `{mutant.line}`: {mutant.new} for {mutant.old}"
        for mutant, fates in by_mutant.items()
        if not {KILLED, HUNG} & {*fates.values()}
    ]
    return "\n".join([*rows, "", f"{len(by_mutant)} mutants, {len(left)} survivors", *left])


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line. The tests must pass without mutants."""
    parser = argparse.ArgumentParser(prog="mutate", description="Change code, and look which kind of test notices.")
    parser.add_argument("--count", type=int, default=100, help="mutants to draw [100]")
    parser.add_argument("--seed", type=int, default=1, help="the seed of the draw [1]")
    parser.add_argument("--results", type=Path, default=ROOT / "out/mutation/killers.jsonl", help="results so far")
    parser.add_argument(
        "--killers", nargs="+", metavar="KILLER", choices=[one.name for one in KILLERS], help="try these only [all]"
    )
    parser.add_argument("--jobs", type=int, default=2, help="mutants that are tried at the same time [2]")
    options = parser.parse_args(words)
    options.results.parent.mkdir(parents=True, exist_ok=True)
    options.results.touch()
    lines = [json.loads(line) for line in options.results.read_text().splitlines()]
    known = {(Place(*line["place"]), line["killer"]) for line in lines}
    killers = [one for one in KILLERS if not options.killers or one.name in options.killers]
    work = [
        (mutant, killer)
        for mutant in drawn(ROOT, options.count, options.seed)
        for killer in killers
        if (mutant.place, killer.name) not in known
    ]
    with tempfile.TemporaryDirectory(prefix="mutate-") as folder, options.results.open("a") as results:
        trees = SimpleQueue[Path]()
        copy(ROOT, Path(folder, "0"))
        compile_all(Path(folder, "0"))
        for job in range(options.jobs):
            if job:
                shutil.copytree(Path(folder, "0"), Path(folder, str(job)), symlinks=True)
            trees.put(Path(folder, str(job)))
        uses = Uses(Path(folder, "0"))

        def tried(pair: tuple[Mutant, Killer]) -> dict[str, Any]:
            mutant, killer = pair
            tree = trees.get()
            try:
                result = attempt(uses, tree, mutant, killer)
            finally:
                trees.put(tree)
            return {"id": str(mutant), "killer": killer.name, **result, "place": mutant.place, "diff": mutant.diff}

        with ThreadPoolExecutor(options.jobs) as pool:
            for line in pool.map(tried, work):
                lines.append(line)
                results.write(json.dumps(line) + "\n")
                results.flush()
                sys.stdout.write(f"{line['fate']:9} {line['killer']:12} {line['id']}\n")
                sys.stdout.flush()
    sys.stdout.write(table(lines) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
