"""The question of a study, and its TOML file for `robochoc experiment` (docs/guides/experiments.md)."""

from __future__ import annotations

import msgspec

from robochoc.app.runs.fitting import fitting_protocols, team_of
from robochoc.app.runs.prepared_team import TeamFiles
from robochoc.app.sketch.sentences import listed
from robochoc.app.sketch.sketch import MAX_LABEL, Sketch
from robochoc.app.studies.families import Family, family_of
from robochoc.app.texts import say
from robochoc.experiments.study import toml_of
from robochoc.formats.names import is_name
from robochoc.model.problem import ProblemKind
from robochoc.run.facts import Facts
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import prepare

MOST_RUNS = 100
MOST_SECONDS = 600
_COMMON = ("afc-ng", "abt", "sfb", "dpop", "afb")
"""The candidates for the second protocol, in addition to the protocol chosen by `auto`."""


class StudyQuestion(msgspec.Struct, frozen=True):
    """The question of a study.

    Attributes:
        protocols: The protocols, at least two.
        family: True if the problems are from the most similar family, instead of the team's own problem.
        runs: The number of runs of each protocol, or of problems of each kind.
        timeout: The time limit for a run in seconds.
        ordered: True if the team's order is used: for a partially known constraint, the order determines which of the
            two robots asks the other.
    """

    protocols: tuple[str, ...]
    family: bool = False
    runs: int = 10
    timeout: int = 20
    ordered: bool = False


class PossibleQuestions(msgspec.Struct, frozen=True):
    """The possible questions for a team.

    Attributes:
        protocols: The suitable protocols, complete ones first, each with whether it is complete.
        usual: The two protocols that are selected at first.
        costs: True if there are costs.
        family: The most similar family, if there is one.
        ordered: True if the team's order is fixed.
    """

    protocols: tuple[tuple[str, bool], ...]
    usual: tuple[str, ...]
    costs: bool
    family: Family | None
    ordered: bool = False


def possible(sketch: Sketch, files: TeamFiles | None = None) -> PossibleQuestions:
    """Return the possible questions for the team given by a sketch or by files.

    Raises:
        NotReadyError: if the sketch is incomplete.
        InvalidInputError: if the files are damaged.
    """
    team = team_of(sketch, files)
    options = Options(runtime=Runtime.SIMULATOR)
    fit = fitting_protocols(team, options)
    chosen = prepare(team, options).choice.options.protocol
    names = [name for name, _ in fit]
    beside = next((name for name in (*_COMMON, *names) if name in names and name != chosen), None)
    usual = tuple(name for name in (chosen, beside) if name in names)
    family = None if files else family_of(sketch)
    partial = Facts(team).partially_known
    return PossibleQuestions(fit, usual, team.kind == ProblemKind.DISWCSP, family, ordered=partial)


def folder_of(sketch: Sketch) -> str:
    """Return the name of the team's folder inside a study's folder."""
    return sketch.name if is_name(sketch.name) and len(sketch.name) <= MAX_LABEL else "team"


def number_of_runs(question: StudyQuestion, family: Family | None) -> int:
    """Return the total number of runs."""
    kinds = family.points if question.family and family else 1
    return len(question.protocols) * question.runs * kinds


def title_of(sketch: Sketch, question: StudyQuestion) -> str:
    """Return the title of the report."""
    key = "compare.title-family" if question.family else "compare.title-team"
    return say(key, protocols=listed(question.protocols), team=folder_of(sketch))


def study_of(sketch: Sketch, question: StudyQuestion, family: Family | None) -> str:
    """Return the TOML text of the study."""
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
