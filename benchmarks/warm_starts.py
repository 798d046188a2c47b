"""Part `starts`: epochs that begin from the last assignment, beside epochs without it (`--cold`).

Twenty scenarios with costs and ten without, of six events each, in the simulator. Counts are of the epochs after the
first, which is the same in both. CPU is that of whole runs in this process, cold and warm in turns.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import replace

from measure import say
from report import Row, Section

from robochoc.generators.families import FAMILIES
from robochoc.generators.scenario import random_scenario
from robochoc.model.costs import normalized
from robochoc.model.outcome import EpochOutcome, Outcome, Verdict
from robochoc.model.problem import Team
from robochoc.run import Options, Runtime, solve

Families = dict[str, tuple[str, dict[str, object]]]

EVENTS = 6
RATE = 0.03
"""At least one change in each event."""
SEEDS = range(5)
MESSAGES = 400_000
FAMILIES_WITH_COSTS: Families = {
    "random costs": ("random", {"agents": 9, "domain": 4, "density": 0.4, "max_cost": 20}),
    "hard and soft": ("random", {"agents": 9, "domain": 5, "density": 0.4, "max_cost": 20, "tightness": 0.2}),
    "soft colouring": ("coloring", {"agents": 12, "colors": 3, "degree": 4, "conflicts": "soft"}),
    "weighted colouring": ("coloring", {"agents": 12, "colors": 3, "degree": 4, "conflicts": "weighted"}),
}
FAMILIES_WITHOUT: Families = {
    "easy": ("random", {"agents": 20, "domain": 6, "density": 0.25, "tightness": 0.3}),
    "hard": ("random", {"agents": 15, "domain": 5, "density": 0.48, "tightness": 0.32}),
}
COMPLETE = ("sfb", "afb", "syncbb", "ncbb", "pt-fb", "hs-cai", "bnb-adopt")
LOCAL = ("dsa", "mgm", "mgm2", "gdba")
SATISFACTION = ("abt", "afc-ng", "agile-abt", "dynabt")


class Sums:
    """The sums over the runs of one protocol, cold or warm."""

    def __init__(self) -> None:
        self.messages = self.ncccs = self.changed = self.kept = 0
        self.cpu_s = self.cost = 0.0
        self.undecided = 0

    def add(self, outcome: Outcome, cpu_s: float) -> None:
        """Add a run."""
        self.cpu_s += cpu_s
        for before, epoch in zip(outcome.epochs, outcome.epochs[1:], strict=False):
            self.messages += sum(epoch.metrics.messages.values())
            self.ncccs += epoch.metrics.ncccs
            self.cost += float(epoch.cost or 0)
            self.undecided += epoch.verdict == Verdict.UNKNOWN
            changed, there = _changes(before, epoch)
            self.changed += changed
            self.kept += there

    @property
    def share(self) -> str:
        """The share of values that changed from one epoch to the next."""
        return f"{self.changed / max(1, self.kept):.0%}"


def measured() -> Section:
    """Return tables for protocols with costs, local search, and protocols without costs."""
    head: Row = (
        "protocol", "messages cold", "warm", "ratio", "NCCCs ratio", "CPU ratio", "changed values cold", "warm",
    )  # fmt: skip
    teams = [*_teams(FAMILIES_WITH_COSTS)]
    complete = [head, *(_row(protocol, teams) for protocol in COMPLETE)]
    local = [(*head, "cost ratio"), *(_row(protocol, teams, costs=True) for protocol in LOCAL)]
    without = [head, *(_row(protocol, [*_teams(FAMILIES_WITHOUT)]) for protocol in SATISFACTION)]
    notes = (
        f"Each of {len(teams)} scenarios with costs (and {len(FAMILIES_WITHOUT) * len(SEEDS)} without) has {EVENTS}"
        f" events with a share of {RATE:g} of the constraints as changes, at least one. Ratios are warm to cold, of"
        " sums over all scenarios: below 1, the start saves something. Changed values: the share of values, of"
        " variables in two successive epochs, that differ between them. Costs of local search are summed over"
        " epochs. `dynabt` keeps its own knowledge in both."
    )
    captions = ("Complete protocols for costs", "Local search", "Protocols without costs")
    return Section("starts", "Epochs from the last assignment", notes, (complete, local, without), captions)


def _teams(families: Families) -> Iterable[Team]:
    for name, parameters in families.values():
        for seed in SEEDS:
            team = FAMILIES[name](**parameters, seed=seed)
            yield random_scenario(team, EVENTS, RATE, seed)


def _row(protocol: str, teams: Iterable[Team], *, costs: bool = False) -> Row:
    cold, warm = Sums(), Sums()
    for team in teams:
        say(f"{protocol} {team.name}")
        options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, messages=MESSAGES, cache=False)
        normalized(team)
        for is_cold, sums in ((True, cold), (False, warm)):
            began = time.process_time()
            outcome = solve(team, replace(options, cold=is_cold))
            sums.add(outcome, time.process_time() - began)
    if cold.undecided or warm.undecided:
        say(f"{protocol}: {cold.undecided} epochs undecided cold, {warm.undecided} warm")
    row = (
        f"`{protocol}`",
        f"{cold.messages:,}",
        f"{warm.messages:,}",
        _ratio(warm.messages, cold.messages),
        _ratio(warm.ncccs, cold.ncccs),
        _ratio(warm.cpu_s, cold.cpu_s),
        cold.share,
        warm.share,
    )
    return (*row, f"{warm.cost / cold.cost:.3f}") if costs else row


def _ratio(warm: float, cold: float) -> str:
    return f"{warm / cold:.2f}" if cold else "-"


def _changes(before: EpochOutcome, now: EpochOutcome) -> tuple[int, int]:
    """Return the number of variables whose value has changed, and of variables that have a value in both epochs."""
    both = before.assignment.keys() & now.assignment.keys()
    return sum(before.assignment[name] != now.assignment[name] for name in both), len(both)
