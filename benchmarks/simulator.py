"""Part `simulator`: how fast it is, and what its counts are."""

from __future__ import annotations

from measure import RUNS, say, spread
from report import Row, Section

from robochoc.generators.queens3d import queens3d
from robochoc.model.outcome import Metrics
from robochoc.model.problem import Team
from robochoc.run import Options, Runtime, solve

SEEDS = range(10)
KINDS = ("Ok", "Nogood", "AddLink")


def measured() -> Section:
    """Speed on n = 7 full, counts on n = 4 planar."""
    notes = (
        "ABT, schedule concurrent, no delays, in this process: without reading files and without starting Python. "
        "First table: messages sent a second of the search, the same seed each time. Second: exact counts, by seed "
        f"{SEEDS[0]}..{SEEDS[-1]}. Median (min..max)."
    )
    return Section("simulator", "The simulator", notes, (_speed(), _counts()))


def _speed() -> list[Row]:
    say("simulator, n = 7 full")
    team = queens3d(7, "full")
    runs = [_metrics(team, 0) for _ in range(RUNS)]
    rates = [sum(run.messages.values()) / run.wall_s / 1e3 for run in runs]
    row = ("7", "full", f"{sum(runs[0].messages.values()):,}", spread(run.wall_s for run in runs), spread(rates, 0))
    return [("n", "model", "messages", "wall s", "thousand messages a second"), row]


def _counts() -> list[Row]:
    say("simulator, n = 4 planar, ten seeds")
    team = queens3d(4)
    runs = [_metrics(team, seed) for seed in SEEDS]
    rows = [(kind, spread((run.messages.get(kind, 0) for run in runs), 0)) for kind in KINDS]
    return [("n = 4 planar", "by seed"), *rows, ("NCCCs", spread((run.ncccs for run in runs), 0))]


def _metrics(team: Team, seed: int) -> Metrics:
    return solve(team, Options(runtime=Runtime.SIMULATOR, seed=seed)).metrics
