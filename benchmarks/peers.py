"""Parts `peers` and `peers_costs`: other libraries on the same problems, where they are installed."""

from __future__ import annotations

import os
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from contestants import Answer, Contestant, central, contestants, right
from measure import say, spread
from peer_problems import OPTIMISATION, SATISFACTION, Family, write_problem
from peer_runs import Run, watched
from report import Row, Section

READING = Path(__file__).with_name("peers.md")
HEAD = ("library", "algorithm", "how", "answers", "messages", "CPU s", "wall s", "peak MB")
BEST = ("problems", "library", "algorithm", "how", "CPU s", "wall s")
CENTRAL_S = 120
REFUSED = 2
"""The exit status of our commands, where they are asked for what this version has not."""
NOT_YET = "not in this version"


@dataclass(frozen=True)
class Result:
    """The run of one contestant on one problem, and its answer."""

    seed: int
    run: Run
    answer: Answer | None
    """None: the run was cut off."""


def measured() -> Section:
    """Part `peers`: satisfaction, and how all is measured."""
    return _section("peers", "Other libraries on the same problems", READING.read_text().strip(), SATISFACTION)


def measured_costs() -> Section:
    """Part `peers_costs`: costs, and local search."""
    notes = "As above: the same libraries, in turns, on problems with costs."
    return _section("peers_costs", "Other libraries on the same problems with costs", notes, OPTIMISATION)


def _section(part: str, title: str, notes: str, families: Sequence[Family]) -> Section:
    loads: list[float] = []
    found = {family: _results(family, loads) for family in families}
    described = [*map(_described, families), "", load_told(loads)]
    tables = [fastest(found), *(_table(*one) for one in found.items())]
    captions = ("Fastest of each library", *(family.name for family in families))
    return Section(part, title, "\n".join([notes, "", *described]), tuple(tables), captions)


def load_told(loads: Sequence[float]) -> str:
    """Return what else the machine had to do: the least and the greatest of its loads at the start of each problem."""
    return f"The machine's load meanwhile: {min(loads):.0f} to {max(loads):.0f} on {os.cpu_count()} cores."


def _described(family: Family) -> str:
    seeds = list(family.seeds)
    limits = f"limit {family.cpu_s} s of CPU, {family.limit_s:g} s in all"
    return f"- *{family.name}*: {family.text}; {_numbers(seeds)}, {limits}."


def _numbers(seeds: Sequence[int]) -> str:
    return f"seeds {seeds[0]}..{seeds[-1]}" if len(seeds) > 1 else f"seed {seeds[0]}"


def _results(family: Family, loads: list[float]) -> dict[Contestant, list[tuple[Result, str]]]:
    """Of each contestant its results, each with the right answer (empty where a problem has no single one)."""
    found: dict[Contestant, list[tuple[Result, str]]] = {one: [] for one in contestants(family)}
    for turn, seed in enumerate(family.seeds):
        say(f"{family.name}, seed {seed}")
        loads.append(os.getloadavg()[0])
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch) / "problem"
            write_problem(family.team(seed), folder)
            truth = right(watched(central(folder), CENTRAL_S)) if family.decided else ""
            order = list(found) if turn % 2 == 0 else list(reversed(found))
            for one in order:
                if not one.missing and not gives_up([result for result, _ in found[one]]):
                    found[one].append((solved(one, folder, seed, family), truth))
    return found


def gives_up(results: Sequence[Result]) -> bool:
    """Whether somebody was cut off, and is spared the other problems of the family."""
    return any(result.answer is None for result in results)


def solved(one: Contestant, folder: Path, seed: int, family: Family) -> Result:
    """Have one contestant solve the problem in `folder`."""
    run = watched(one.command(folder), family.limit_s, family.cpu_s)
    if run.status is None:
        return Result(seed, run, None)
    try:
        return Result(seed, run, one.answer(folder, run))
    except (ValueError, LookupError, OSError):
        said = (run.errors.strip() or run.output.strip() or f"status {run.status}").splitlines()[-1]
        told = said.replace(f"{folder}/", "")[:80]
        return Result(seed, run, Answer(NOT_YET if run.status == REFUSED else f"failed: {told}"))


def agrees(found: str, truth: str) -> bool:
    """Whether an answer is the right one. To those who know only costs, a solution is one of cost 0."""
    same = {"solution": "0"}
    return same.get(found, found) == same.get(truth, truth)


def _table(family: Family, found: dict[Contestant, list[tuple[Result, str]]]) -> list[Row]:
    return [HEAD, *(row_of(one, family, results) for one, results in found.items())]


def row_of(one: Contestant, family: Family, results: list[tuple[Result, str]]) -> Row:
    """One contestant's line."""
    who = (one.library, one.algorithm, one.way)
    if one.missing:
        return (*who, f"skipped: {one.missing}", *["-"] * 4)
    if all(result.answer and result.answer.found == NOT_YET for result, _ in results):
        return (*who, NOT_YET, *["-"] * 4)
    good = _good(family, results)
    runs = [result.run for result, _ in results]
    counts = [result.answer.messages for result in good if result.answer and result.answer.messages is not None]
    return (
        *who,
        _answers(family, results, good),
        spread(counts, 0) if counts else "not counted" if good else "-",
        spread(run.cpu_s for run in runs),
        spread(run.wall_s for run in runs),
        spread((run.peak_mb for run in runs), 0),
    )


def _good(family: Family, results: Iterable[tuple[Result, str]]) -> list[Result]:
    """The results that are right; in a family without right answers, those that are costs."""
    if family.decided:
        return [result for result, truth in results if result.answer and agrees(result.answer.found, truth)]
    return [result for result, _ in results if result.answer and result.answer.found.replace(".", "", 1).isdigit()]


def _answers(family: Family, results: list[tuple[Result, str]], good: list[Result]) -> str:
    """How many were right, and what the others were; or the costs."""
    words = []
    if family.decided:
        words.append(f"{len(good)} of {len(results)} right")
    elif good:
        words.append(f"cost {spread((float(one.answer.found) for one in good if one.answer), 0)}")
    others: dict[str, list[str]] = defaultdict(list)
    for result, truth in results:
        if result not in good:
            what = "over the limit" if result.answer is None else _differs(result.answer.found, truth)
            others[what].append(str(result.seed))
    unsolved = [str(seed) for seed in family.seeds if seed not in {result.seed for result, _ in results}]
    told = [f"{what}: seed {', '.join(seeds)}" for what, seeds in others.items()]
    if gives_up([result for result, _ in results]) and unsolved:
        told.append(f"not run: seed {', '.join(unsolved)}")
    return "; ".join([*words, *told])


def _differs(found: str, truth: str) -> str:
    if truth and (found in {"solution", "no-solution"} or found.replace(".", "", 1).isdigit()):
        return f"WRONG ({found}, not {truth})"
    return found


def fastest(found: dict[Family, dict[Contestant, list[tuple[Result, str]]]]) -> list[Row]:
    """Of each library the contestant with the least CPU among those that answered everything, by family."""
    rows: list[Row] = [BEST]
    for family, results in found.items():
        for library in dict.fromkeys(one.library for one in results):
            able = [
                (median(result.run.cpu_s for result, _ in of_one), one)
                for one, of_one in results.items()
                if one.library == library and of_one and len(_good(family, of_one)) == len(of_one)
            ]
            if able:
                _, one = min(able, key=lambda pair: pair[0])
                runs = [result.run for result, _ in results[one]]
                figures = (spread(run.cpu_s for run in runs), spread(run.wall_s for run in runs))
                rows.append((family.name, library, one.algorithm, one.way, *figures))
    return rows
