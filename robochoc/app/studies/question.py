"""What is compared, and the study that says so: a TOML file of `robochoc experiment` (docs/guides/experiments.md)."""

from __future__ import annotations

import msgspec

from robochoc.app.runs.fitting import fitting_protocols, team_of
from robochoc.app.runs.prepared_team import TeamFiles
from robochoc.app.sketch.sketch import MAX_LABEL, Sketch
from robochoc.app.sketch.words import listed
from robochoc.app.studies.families import Family, family_of
from robochoc.app.texts import say
from robochoc.experiments.study import toml_of
from robochoc.formats.names import is_name
from robochoc.model.problem import ProblemKind
from robochoc.run.choice import decided
from robochoc.run.facts import Facts
from robochoc.run.options import Options, Runtime

MOST_RUNS = 100
MOST_SECONDS = 600
_COMMON = ("afc-ng", "abt", "sfb", "dpop", "afb")
"""Protocols that are chosen beside what `auto` takes, the first that fits."""


class Question(msgspec.Struct, frozen=True):
    """What is asked.

    Attributes:
        protocols: The protocols, two at least.
        family: Whether the problems are of the family that is most like the team. Else it is the team.
        runs: Runs of each protocol, or problems of each kind.
        timeout: The limit of a run in seconds.
        ordered: Whether the team's own order is kept: a partially known constraint says who of two asks.
    """

    protocols: tuple[str, ...]
    family: bool = False
    runs: int = 10
    timeout: int = 20
    ordered: bool = False


class Possible(msgspec.Struct, frozen=True):
    """What can be compared on a team.

    Attributes:
        protocols: The protocols that fit, complete ones first, and whether each is complete.
        usual: Two of them to begin with.
        costs: Whether there are costs.
        family: The family most like it, if there is one.
        ordered: Whether its order cannot be another one.
    """

    protocols: tuple[tuple[str, bool], ...]
    usual: tuple[str, ...]
    costs: bool
    family: Family | None
    ordered: bool = False


def possible(sketch: Sketch, files: TeamFiles | None = None) -> Possible:
    """Return what can be compared on the team of a sketch, or of files.

    Raises:
        NotReadyError: for a sketch that is no team yet.
        InvalidInputError: if the files are damaged.
    """
    team = team_of(sketch, files)
    options = Options(runtime=Runtime.SIMULATOR)
    fit = fitting_protocols(team, options)
    chosen = decided(team, options).options.protocol
    names = [name for name, _ in fit]
    beside = next((name for name in (*_COMMON, *names) if name in names and name != chosen), None)
    usual = tuple(name for name in (chosen, beside) if name in names)
    family = None if files else family_of(sketch)
    partial = Facts(team).partially_known
    return Possible(fit, usual, team.kind == ProblemKind.DISWCSP, family, ordered=partial)


def folder_of(sketch: Sketch) -> str:
    """Return the name of the team's folder beside a study."""
    return sketch.name if is_name(sketch.name) and len(sketch.name) <= MAX_LABEL else "team"


def number_of_runs(question: Question, family: Family | None) -> int:
    """Return how many runs there are in all."""
    kinds = family.points if question.family and family else 1
    return len(question.protocols) * question.runs * kinds


def title_of(sketch: Sketch, question: Question) -> str:
    """Return what heads the report."""
    key = "compare.title-family" if question.family else "compare.title-team"
    return say(key, protocols=listed(question.protocols), team=folder_of(sketch))


def study_of(sketch: Sketch, question: Question, family: Family | None) -> str:
    """Return the study, as the text of its file."""
    seeds = f"1..{question.runs}"
    runs: dict[str, object] = {"protocol": [*question.protocols]}
    if question.family and family:
        problems: dict[str, object] = {"family": family.name, **family.options, "seed": seeds}
    else:
        problems = {"path": [folder_of(sketch)]}
        runs |= {} if sketch.is_ranked or question.ordered else {"order": "random"}
        runs["seed"] = seeds
    tables = {"problems": problems, "runs": runs, "limits": {"timeout": question.timeout}}
    return toml_of({"title": title_of(sketch, question), **tables})
