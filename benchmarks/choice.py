"""Part `choice`: CPU of `--protocol auto` beside that of the best protocol and order, on problems of many families.

    python benchmarks/choice.py                  # problems that change: to go on, or to begin anew
    python benchmarks/choice.py --limit 20

A process for each problem generates its team once, and runs every candidate in the simulator. Measured is what depends
on the choice: reordering the team, and the search; for `auto` also the choice itself. The figures of each problem are
kept in out/bench/choice.jsonl, and measured anew only if `auto` chooses something else, or without this file. The table
of all runs is results/choice.csv.
"""

from __future__ import annotations

import argparse
import csv
import gc
import json
import math
import multiprocessing
import signal
import statistics
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from choice_problems import PROBLEMS, problem
from measure import ROOT, say
from report import Row, Section

from robochoc.generators.coloring import coloring
from robochoc.generators.random_csp import random_csp
from robochoc.generators.scenario import random_scenario
from robochoc.model.costs import normalized
from robochoc.model.orders import Order, with_order
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.run import Options, Runtime, solve
from robochoc.run.choice import choose, refusal
from robochoc.run.context import RunContext
from robochoc.run.facts import Facts, tree_tables
from robochoc.run.phases import first_phase
from robochoc.run.registry import protocol_named
from robochoc.run.runtimes import SessionRequest, open_session
from robochoc.solver.errors import UnsupportedError

SEEDS = range(9)
HELD_BACK = range(6, 9)
"""The rules of `auto` were derived from problems with other seeds."""
ORDERS = (Order.GIVEN, Order.MAX_DEGREE, Order.MIN_WIDTH, Order.DFS)
WITHOUT_COSTS = (
    *(("abt", order) for order in ORDERS[:3]),
    *(("afc-ng", order) for order in ORDERS),
    *(("sfb", order) for order in ORDERS[:3]),
    *(("sbt", order) for order in ORDERS[:2]),
)
WITH_COSTS = (
    ("dpop", Order.GIVEN),
    *(("sfb", order) for order in ORDERS),
    *((protocol, Order.GIVEN) for protocol in ("hs-cai", "ncbb", "pt-fb")),
    ("afb", Order.DFS),
)
"""The candidates. They were selected on one problem of each of 24 families, 20 without costs and 4 with costs, from 15
and 13 protocols in some orders; one of these families (3D queens by row) was removed later, and the other families were
not compared. No other protocol was faster than the best candidate by more than a tenth; `abt` in two other orders was:
`dfs` (random small) and `dom-deg` (small-world)."""
LIMIT_S = 6.0
"""The limit of CPU for the choice of `auto`, and for others until one has ended."""
CUT = 1.6
"""Candidates are stopped at this multiple of the fastest so far, and `MARGIN_S`."""
MARGIN_S = 0.01
MOST_CELLS = 30_000_000
"""DPOP is not tried if a table would have more entries."""
REPEATED_S = 0.15
"""Runs up to this length are measured three times, and the fastest counts."""
CHECKED_S = 0.02
"""The seconds between checks of the limit. A timer of CPU would make the clock of CPU coarse."""
LONG_S = 0.05
"""Regrets count as poor only if more CPU than this is lost."""
KEPT = ROOT / "out" / "bench" / "choice.jsonl"
TABLE = Path(__file__).with_name("results") / "choice.csv"
CHANGING: tuple[tuple[str, Callable[[int], Team]], ...] = (
    ("random, 15 robots, 8 values, density .5, tightness .28", lambda seed: _linked(15, 8, 0.5, 0.28, seed)),
    ("random, 15 robots, 8 values, .5, .36", lambda seed: _linked(15, 8, 0.5, 0.36, seed)),
    ("random, 15 robots, 8 values, .5, .44", lambda seed: _linked(15, 8, 0.5, 0.44, seed)),
    ("random, 20 robots, 5 values, .22, .45", lambda seed: _linked(20, 5, 0.22, 0.45, seed)),
    ("3-colouring, 25 robots, degree 4", lambda seed: coloring(25, 3, 4, seed, conflicts="hard")),
    ("random, 25 robots, 5 values, .18, .42", lambda seed: _linked(25, 5, 0.18, 0.42, seed)),
    ("random, 40 robots, 5 values, .08, .55", lambda seed: _linked(40, 5, 0.08, 0.55, seed)),
)
"""A name, and what makes a problem of a seed; ten events change it."""

Measured = dict[str, Any]
"""The figures of one problem, as they are kept."""


class OutOfTime(BaseException):
    """The limit of a run has been reached."""


def measured() -> Section:
    """Measure all problems, write the table, and return a summary."""
    rows = list(_measured([(family, seed) for family in PROBLEMS for seed in SEEDS]))
    _write(rows)
    return _section(rows)


def _measured(problems: Iterable[tuple[str, int]]) -> Iterator[Measured]:
    """Yield the figures of each problem; keep them."""
    KEPT.parent.mkdir(parents=True, exist_ok=True)
    KEPT.touch()
    kept = {(row["family"], row["seed"]): row for row in map(json.loads, KEPT.read_text().splitlines())}
    _warm_up()
    with multiprocessing.get_context("fork").Pool(1, maxtasksperchild=1) as pool, KEPT.open("a") as file:
        for row in pool.imap(_measure, ((one, kept.get(one)) for one in problems)):
            say(f"{row['family']} {row['seed']}: auto {row['auto']} {_auto_s(row):.4f} s, best {_best(row)}")
            print(json.dumps(row), file=file, flush=True)
            yield row


# One problem


def _warm_up() -> None:
    """Import everything that is imported on first use."""
    for family, candidates in (("random small", WITHOUT_COSTS), ("costs small", WITH_COSTS)):
        team = problem(family, 0)
        choose(team, Options(runtime=Runtime.SIMULATOR))
        for protocol, order in candidates:
            _run(normalized(team), protocol, order, 1.0)


def _measure(task: tuple[tuple[str, int], Measured | None]) -> Measured:
    """Measure the choice for a problem, and every candidate, unless `auto` chooses the same as in the kept figures."""
    which, kept = task
    options = Options(runtime=Runtime.SIMULATOR, cache=False)
    deciding_s = math.inf
    for _ in range(3):
        gc.collect()
        team = problem(*which)
        refusal("sfb", normalized(team), options)  # as in every run; the results are stored with the team
        began = time.process_time()
        chosen = choose(team, options).options
        deciding_s = min(deciding_s, time.process_time() - began)
    team = normalized(team)
    facts = Facts(team)
    auto = (chosen.protocol, Order(str(chosen.order or Order.GIVEN)))
    if kept and kept["auto"] == " ".join(auto):
        return {**kept, "deciding_s": deciding_s, "runs": _in_turns(team, kept["runs"], " ".join(auto))}
    runs: dict[str, float | None] = {}
    for protocol, order in dict.fromkeys((auto, *(WITH_COSTS if facts.has_costs else WITHOUT_COSTS))):
        if _is_candidate(team, facts, protocol):
            best = min((one for one in runs.values() if one), default=math.inf)
            limit_s = LIMIT_S if (protocol, order) == auto else min(LIMIT_S, CUT * best + MARGIN_S)
            runs[f"{protocol} {order}"] = _fastest(team, protocol, order, limit_s)
    return {
        "family": which[0], "seed": which[1], "team": team.name, "robots": facts.robots, "links": facts.links,
        "constrainedness": round(facts.constrainedness, 2), "width": facts.tree.width,
        "auto": " ".join(auto), "deciding_s": deciding_s, "runs": _in_turns(team, runs, " ".join(auto)),
    }  # fmt: skip


def _in_turns(team: Team, runs: dict[str, float | None], auto: str) -> dict[str, float | None]:
    """Return `runs` with those of `auto` and of the fastest two repeated in turns; the fastest run of each counts."""
    ended = sorted((spent_s, name) for name, spent_s in runs.items() if spent_s)
    again = dict.fromkeys([*([auto] if runs.get(auto) else []), *(name for _, name in ended[:2])])
    found = dict(runs)
    for _ in range(3 if ended and ended[0][0] < REPEATED_S else 1):
        for name in again:
            protocol, order = name.split()
            before = found[name] or math.inf
            found[name] = min(before, _run(team, protocol, Order(order), LIMIT_S) or before)
    return found


def _is_candidate(team: Team, facts: Facts, protocol: str) -> bool:
    """Return whether `protocol` accepts the team, and proves its answers."""
    if protocol == "dpop" and tree_tables(facts.graph, team.order, facts.sizes, MOST_CELLS).cells > MOST_CELLS:
        return False
    return protocol_named(protocol).traits.complete and not refusal(protocol, team, Options(runtime=Runtime.SIMULATOR))


def _fastest(team: Team, protocol: str, order: Order, limit_s: float) -> float | None:
    """Return the CPU seconds of the fastest of up to three runs; None if a run did not end within the limit."""
    found: float | None = None
    for _ in range(3):
        spent_s = _run(team, protocol, order, limit_s)
        if spent_s is None:
            return found
        found = min(spent_s, found or spent_s)
        if found > REPEATED_S:
            break
    return found


def _run(team: Team, protocol: str, order: Order, limit_s: float) -> float | None:
    """Return the CPU seconds for reordering and searching; None if the run did not end within the limit."""
    options = Options(protocol, Runtime.SIMULATOR, cache=False)
    gc.collect()
    began = time.process_time()
    ordered = with_order(team, order)
    reordering_s = time.process_time() - began
    compiled = RunContext(options).team_compiler().compile(ordered, every=True)
    phase = first_phase(options, protocol_named(protocol), lambda: 0)
    began = time.process_time()

    running = True

    def check(*_: object) -> None:
        if running and time.process_time() - began + reordering_s > limit_s:
            raise OutOfTime
        signal.setitimer(signal.ITIMER_REAL, CHECKED_S if running else 0)

    signal.signal(signal.SIGALRM, check)
    try:
        check()
        with open_session(SessionRequest(phase.protocol, compiled, phase.parameters, options)) as session:
            result = session.search()
        running = False
    except (OutOfTime, UnsupportedError, MemoryError):
        running = False
        return None
    spent_s = reordering_s + time.process_time() - began
    return None if result.verdict is Verdict.UNKNOWN else spent_s


# The table


def _best(row: Measured) -> tuple[str, float] | None:
    """Return the fastest candidate, and its CPU seconds; None if none has ended."""
    ended = [(name, spent_s) for name, spent_s in row["runs"].items() if spent_s]
    return min(ended, key=lambda one: one[1], default=None)


def _best_s(row: Measured) -> float:
    best = _best(row)
    return best[1] if best else math.inf


def _auto_s(row: Measured) -> float:
    """Return the CPU seconds of `auto`, its choice included."""
    return float(row["deciding_s"] + (row["runs"].get(row["auto"]) or math.inf))


def _regret(row: Measured) -> float:
    """Return the CPU of `auto` over that of the best candidate."""
    return _auto_s(row) / _best_s(row)


def _write(rows: list[Measured]) -> None:
    """Write the table of all runs: milliseconds of CPU; `>` for a run that was stopped."""
    names = list(dict.fromkeys(name for row in rows for name in row["runs"]))
    facts = ("family", "seed", "team", "robots", "links", "constrainedness", "width", "auto")
    with TABLE.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*facts, "choice ms", *(f"{name} ms" for name in names)])
        for row in rows:
            cells = [_milliseconds(row["runs"][name]) if name in row["runs"] else "" for name in names]
            writer.writerow([*(row[fact] for fact in facts), _milliseconds(row["deciding_s"]), *cells])


def _milliseconds(seconds: float | None) -> str:
    return f"{seconds * 1e3:.3g}" if seconds else ">"


def _section(rows: list[Measured]) -> Section:
    proven = [row for row in rows if _best(row)]
    robots = [row["robots"] for row in rows]
    notes = (
        f"{len(rows)} problems of {len(PROBLEMS)} families (`benchmarks/choice_problems.py`), seeds {SEEDS[0]} to"
        f" {SEEDS[-1]}, of {min(robots)} to {max(robots):,} robots, in the simulator. Sizes and difficulties are drawn"
        " from the seed. Regret: CPU of `auto`, its choice included, over CPU of the fastest candidate. The rules were"
        f" derived from the seeds up to {HELD_BACK[0] - 1}. Counted is what depends on the choice: reordering"
        f" and search. Each candidate is stopped at {CUT} times the fastest so far, the choice of `auto` at"
        f" {LIMIT_S:.0f} s; runs up to {REPEATED_S * 1e3:.0f} ms are the fastest of three. Left out are problems that"
        f" no candidate decided: {len(rows) - len(proven)}. All runs: `benchmarks/results/choice.csv`."
    )
    held_back = [row for row in proven if row["seed"] in HELD_BACK]
    known = [row for row in proven if row["seed"] not in HELD_BACK]
    halves = [_summary(name, half) for name, half in (("held back", held_back), ("rules derived from", known))]
    head = ("problems", "number", "median", "90th percentile", "largest", f"over 2.5 and {LONG_S * 1e3:.0f} ms more")
    families = [(name, [row for row in held_back if row["family"] == name]) for name in PROBLEMS]
    by_family = [_family_row(name, own) for name, own in families if own]
    captions = ("Regret", "Regret by family, held back")
    more = ("family", "robots", "median", "largest", "auto chose", "fastest were")
    return Section("choice", "The choice of a protocol", notes, ([head, *halves], [more, *by_family]), captions)


def _summary(name: str, rows: list[Measured]) -> Row:
    regrets = sorted(map(_regret, rows))
    nine = statistics.quantiles(regrets, n=10, method="inclusive")[-1]
    poor = sum(_regret(row) > 2.5 and _auto_s(row) - _best_s(row) > LONG_S for row in rows)
    figures = map(_in_words, (statistics.median(regrets), nine, regrets[-1]))
    return name, str(len(rows)), *figures, str(poor)


def _in_words(regret: float) -> str:
    return f"{regret:.2f}" if regret < math.inf else "not decided"


def _family_row(name: str, rows: list[Measured]) -> Row:
    regrets, robots = [_regret(row) for row in rows], [row["robots"] for row in rows]
    return (
        name,
        f"{min(robots)} to {max(robots):,}",
        _in_words(statistics.median(regrets)),
        _in_words(max(regrets)),
        _listed(row["auto"] for row in rows),
        _listed((_best(row) or ("",))[0] for row in rows),
    )


def _listed(names: Iterable[str]) -> str:
    return ", ".join(dict.fromkeys(names))


# Problems that change


def _linked(robots: int, values: int, density: float, tightness: float, seed: int) -> Team:
    return random_csp(robots, values, density, tightness, seed, connected=True)


def changing(limit_s: float) -> Iterator[str]:
    """Yield the lines of a table with messages and bytes of protocols on problems that change."""
    protocols = ("dynabt", "sfb")
    heads = " | ".join(f"`{name}`: messages | bytes" for name in protocols)
    yield f"| problem | constrainedness | {heads} |\n| --- | --- |{' --- |' * 2 * len(protocols)}"
    for name, make in CHANGING:
        teams = [random_scenario(make(seed), 10, 0.02, seed) for seed in range(3)]
        cells = []
        for protocol in protocols:
            options = Options(protocol, Runtime.SIMULATOR, timeout=limit_s, cache=False)
            found = [solve(team, options) for team in teams]
            undecided = sum(one.verdict is Verdict.UNKNOWN for one in found)
            messages = statistics.median(sum(one.metrics.messages.values()) for one in found)
            sent = statistics.median(one.metrics.bytes for one in found)
            cells.append(f"{undecided} undecided | " if undecided else f"{messages:,.0f} | {sent:,.0f}")
        yield f"| {name} | {Facts(teams[0]).constrainedness:.2f} | {' | '.join(cells)} |"


def main() -> None:
    """Print the table of problems that change."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--limit", type=float, default=6, metavar="SECONDS", help="Limit of a run.")
    for line in changing(arguments.parse_args().limit):
        print(line, flush=True)


if __name__ == "__main__":
    main()
