"""The leaderboard's static site: a page with all tables, and a page for each instance."""

from __future__ import annotations

import html
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path

from robochoc.experiments.html_page import page, table
from robochoc.experiments.summary import number
from robochoc.leaderboard.certificates import Certificate, published
from robochoc.leaderboard.instances import DPOP, FAMILIES
from robochoc.leaderboard.results import LeaderboardResults, RunResult
from robochoc.leaderboard.scores import gap
from robochoc.leaderboard.tables import answer_text, family_tables, holders, overall, peer_remarks, proof_text, sizes_of
from robochoc.system.files import write_atomically

INDEX = "index.html"
EXPLANATION = (
    "The gap is 0 for the best known answer and 1 for none; the area is the mean gap of the best assignment so far over"
    " the budget of messages. Ranks are by the gap, with ties at their mean rank; the brackets have 95 % confidence"
    " intervals (bootstrap). A star marks the protocol of the lowest rank, and those that are not significantly worse"
    " (Wilcoxon's signed-rank test with Holm's correction, 5 %)."
)


def write_site(results: LeaderboardResults, folder: Path) -> int:
    """Write the site, and return the number of its pages. Pages of other results in the folder are replaced.

    Raises:
        OSError: if a page cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / INDEX, page("Leaderboard", "\n".join(_index(results))).encode())
    best = holders(results.runs)
    by_instance: dict[str, list[RunResult]] = {}
    for run in results.runs:
        by_instance.setdefault(run.instance, []).append(run)
    for name, runs in by_instance.items():
        body = "\n".join(_instance(published()[name], runs, best.get(name, [])))
        write_atomically(folder / f"{name}.html", page(name, body).encode())
    return 1 + len(by_instance)


def _index(results: LeaderboardResults) -> Iterator[str]:
    yield _paragraph(budget_text(results))
    yield _paragraph(EXPLANATION)
    yield from map(_paragraph, peer_remarks(results))
    for size in sizes_of(results):
        yield f"<h2>All families, {size}</h2>"
        yield table(*overall(results, size))
        for one in family_tables(results, size):
            family = FAMILIES[one.family]
            yield f"<h2>{html.escape(family.title)}, {size}</h2>"
            yield _paragraph(f"{one.family}: {family.source}.")
            yield table(one.headings, one.lines)
            yield from map(_paragraph, one.remarks)
    yield "<h2>Instances</h2>"
    best = holders(results.runs)
    names = list(dict.fromkeys(run.instance for run in results.runs))
    lines = [[name, answer_text(published()[name]), _names(best.get(name, []))] for name in names]
    yield table(["instance", "answer", "held by"], lines, [f"{name}.html" for name in names])
    entrants = [[one.name, one.package, one.source or "-"] for one in results.entrants]
    yield "<h2>Protocols</h2>" + table(["protocol", "package", "digest of its files"], entrants)


def budget_text(results: LeaderboardResults) -> str:
    """Return the budget of the runs as a sentence."""
    budget = results.budget
    parts = [f"{budget.messages:,} messages"]
    parts += [f"{budget.ncccs:,} NCCCs"] if budget.ncccs else []
    parts += [f"{budget.cycles:,} cycles"] if budget.cycles else []
    return (
        f"Benchmark set {results.benchmark_set}, robochoc {results.robochoc}, seed {results.seed}. Each run has at most"
        f" {', '.join(parts)} and {budget.time_s:g} s, in the simulator."
    )


def _instance(one: Certificate, runs: Sequence[RunResult], best: Sequence[RunResult]) -> Iterator[str]:
    yield f'<p><a href="{INDEX}">All results</a></p>'
    yield _paragraph(f"{FAMILIES[one.family].title}, {one.size}: {one.robots} robots. SHA-256 {one.sha256}.")
    yield _paragraph(f"Answer: {answer_text(one)}. {proof_text(one)}")
    folder = shlex.quote(one.name)
    commands = [
        f"robochoc leaderboard export {folder}",
        *(_proof(folder, name) for name in dict.fromkeys((one.found_by, one.proved_by, one.agreed_by)) if name),
    ]
    yield f"<pre>{html.escape(chr(10).join(commands))}</pre>"
    yield _paragraph(f"Best answer here: {_names(best)}. 'robochoc leaderboard verify' computes its cost again.")
    heads = ["protocol", "status", "verdict", "cost", "gap", "messages", "bytes", "NCCCs"]
    yield table(heads, [_run_line(run, one) for run in runs])
    for run in best[:1]:
        values = ", ".join(f"{name} = {value}" for name, value in run.assignment.items())
        yield _paragraph(f"Assignment of {run.protocol}: {values or 'none'}")


def _proof(folder: str, solver: str) -> str:
    """Return the command that repeats a proof."""
    how = f"--protocol {DPOP} --runtime simulator" if solver == DPOP else f"--protocol central --with {solver}"
    return f"robochoc solve {folder} {how}"


def _run_line(run: RunResult, best: Certificate) -> list[str]:
    counts = [run.messages, run.bytes, run.ncccs]
    cost = "-" if run.cost is None else str(run.cost)
    shown = ["-" if value is None else number(value) for value in counts]
    return [run.protocol, run.status, run.verdict or "-", cost, f"{gap(run, best):.3f}", *shown]


def _names(runs: Sequence[RunResult]) -> str:
    return ", ".join(run.protocol for run in runs) or "no protocol"


def _paragraph(text: str) -> str:
    return f"<p>{html.escape(text)}</p>"
