"""Settings of a study that generate the same problems: they are reported, and counted once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from robochoc.system.plain_text import listed

SEEDS = ("seed", "problem_seed", "scenario_seed")
"""Parameters that are drawn at random: they do not belong to a setting."""

Setting = tuple[tuple[str, Any], ...]


def without_duplicates(
    rows: Sequence[Mapping[str, Any]], parameters: Sequence[str]
) -> tuple[list[Mapping[str, Any]], list[str]]:
    """Return the results of the first of all settings with the same problems, and a sentence about the others.

    Two settings are the same if they have the same problem for each seed. Different seeds of one setting may well have
    the same problem: small problems are often drawn twice.

    Args:
        rows: The results of a study.
        parameters: The names of the problems' parameters.
    """
    problems: dict[Setting, dict[Setting, str]] = {}
    for row in rows:
        seeds = tuple((name, row.get(name)) for name in parameters if name in SEEDS)
        problems.setdefault(_setting(row, parameters), {})[seeds] = row["digest"]
    first: dict[Setting, Setting] = {}
    alike: dict[frozenset[tuple[Setting, str]], list[Setting]] = {}
    for setting, digests in problems.items():
        content = frozenset(digests.items()) if all(digests.values()) else frozenset({(setting, "")})
        alike.setdefault(content, []).append(setting)
    for settings in alike.values():
        first.update(dict.fromkeys(settings, settings[0]))
    kept = [row for row in rows if first[setting := _setting(row, parameters)] == setting]
    return kept, [_sentence(settings) for settings in alike.values() if len(settings) > 1]


def _setting(row: Mapping[str, Any], parameters: Sequence[str]) -> Setting:
    """Return the problems' name and parameters, without the seeds."""
    given = tuple((name, row.get(name)) for name in parameters if name not in SEEDS)
    return (("problems", row.get("problems")), *given)


def _sentence(settings: Sequence[Setting]) -> str:
    """Return a sentence about settings with the same problems."""
    several = [name for place, (name, _) in enumerate(settings[0]) if len({one[place] for one in settings}) > 1]
    words = [", ".join(f"{name} {value}" for name, value in one if name in several) for one in settings]
    return f"{listed(words)} generate the same problems: they are counted once, as {words[0]}."
