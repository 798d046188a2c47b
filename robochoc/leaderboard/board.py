"""A board: a folder with files of results, which are shown together."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec

from robochoc.formats.diagnostics import invalid_input
from robochoc.leaderboard.instances import instances
from robochoc.leaderboard.results import LeaderboardResults, RunResult, read_results, write_results

_HINT = "run the protocols again with the same --budget, --seed and version, or use another board"


def read_board(paths: Sequence[Path]) -> LeaderboardResults:
    """Return the results in files and folders together, in the order of the set.

    Raises:
        InvalidInputError: if a file is invalid, there is none, or the files have different budgets or the same runs.
    """
    files = [file for path in paths for file in (sorted(path.glob("*.json")) if path.is_dir() else [path])]
    if not files:
        raise invalid_input(paths[0], "has no files of results", "robochoc leaderboard submit adds one")
    return _together([(file, read_results(file)) for file in files])


def submit(results: LeaderboardResults, name: str, board: Path) -> Path:
    """Add results to a board, and return their file there. A file of the same name is replaced.

    Raises:
        InvalidInputError: if the other results of the board have another budget, or the same runs.
        OSError: if the file cannot be written.
    """
    board.mkdir(parents=True, exist_ok=True)
    path = board / name
    others = [file for file in sorted(board.glob("*.json")) if file.name != name]
    _together([*((file, read_results(file)) for file in others), (path, results)])
    write_results(results, path)
    return path


def _together(found: Sequence[tuple[Path, LeaderboardResults]]) -> LeaderboardResults:
    _, first = found[0]
    runs: dict[str, dict[str, RunResult]] = {}
    for path, results in found:
        if (results.budget, results.seed, results.robochoc) != (first.budget, first.seed, first.robochoc):
            raise invalid_input(path, f"has another budget, seed or version than {found[0][0]}", _HINT)
        for run in results.runs:
            own = runs.setdefault(run.instance, {})
            if run.protocol in own:
                raise invalid_input(path, f"{run.protocol} on {run.instance} is already on the board", _HINT)
            own[run.protocol] = run
    entrants = {one.name: one for _, results in found for one in results.entrants}
    ordered = [run for one in instances() for run in runs.get(one.name, {}).values()]
    return msgspec.structs.replace(first, entrants=list(entrants.values()), runs=ordered)
