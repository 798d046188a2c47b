"""Prepares a run: writes the team's files into the run's folder, and converts values for the user."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

from robochoc.app.imported.facts import domains_of
from robochoc.app.runs.run import Run
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.sentences import value_in_short
from robochoc.app.sketch.sketch import Sketch, Value
from robochoc.formats import read_team, write_team
from robochoc.model.problem import AddAgent, Change, Domain, Robot, ScenarioEvent, Team
from robochoc.modelling.model import Model
from robochoc.system.lazy_dataclass import dataclass


@dataclass(frozen=True)
class PreparedTeam:
    """A team that is ready for a run.

    Attributes:
        team: The team.
        label: Converts a variable's code to the user's value.
        labels: The user's values that are spelled differently in files, by the spelling in files.
        called: Converts a variable's code to the short text used in messages.
    """

    team: Team
    label: Callable[[str, int], Value]
    labels: dict[str, str]
    called: Callable[[str, int], str]

    @property
    def robots(self) -> list[str]:
        """The names of all robots, including robots that join later."""
        return [robot.name for robot in _robots(self.team)]


@dataclass(frozen=True)
class TeamFiles:
    """The files of an imported team.

    Attributes:
        folder: The folder with the files.
        flies: True if the team's decisions are robots' positions.
        maximised: True if the costs are utilities, whose sum is maximised.
        then: Changes in the team after the problem in the files and its scenario have been solved.
    """

    folder: Path
    flies: bool = True
    maximised: bool = False
    then: tuple[Change, ...] = ()


def prepare_sketch(run: Run, model: Callable[[Sketch], Model]) -> PreparedTeam:
    """Write the files for a run's sketch, converted by `model`. Raises the exceptions of `model`, and `OSError`."""
    converted = model(run.sketch)
    converted.save(run.team)
    return _of_model(converted, run.sketch)


def prepare_files(run: Run, files: TeamFiles) -> PreparedTeam:
    """Write the files of a run's team, unchanged or with later changes. Raises `InvalidInputError`, `OSError`.

    Values are spelled as in the files.
    """
    team = read_team(files.folder)
    if files.then:
        team = replace(team, scenario=(*team.scenario, ScenarioEvent(files.then)))
        write_team(team, run.team)
    else:
        shutil.copytree(files.folder, run.team)
    return _of_files(team)


def from_run(run: Run) -> PreparedTeam:
    """Return the team in an earlier run, from its folder. Raises as `prepare_sketch` and `prepare_files` do."""
    if run.record.flies is not None:  # an imported team
        return _of_files(read_team(run.team))
    return _of_model(model_of(run.sketch), run.sketch)


def _robots(team: Team) -> tuple[Robot, ...]:
    joining = (change.robot for event in team.scenario for change in event.changes if isinstance(change, AddAgent))
    return (*team.robots, *joining)


def _of_model(model: Model, sketch: Sketch) -> PreparedTeam:
    return PreparedTeam(model.team, partial(label_of, model), labels_of(model), called_in(model, sketch))


def _of_files(team: Team) -> PreparedTeam:
    domains = domains_of(team)
    return PreparedTeam(team, partial(_label, domains), {}, lambda name, code: str(_label(domains, name, code)))


def _label(domains: Mapping[str, Domain], name: str, code: int) -> Value:
    shown = domains[name].label(code) if name in domains else code
    return str(shown) if isinstance(shown, float) else shown


def value_of(model: Model, variable: str, code: int) -> Value:
    """Return the user's value for a variable's code."""
    user_values = model.variables[variable].codes.user_values or {}
    value = user_values.get(code, code)
    return value if isinstance(value, (int, str)) else str(value)


def label_of(model: Model, variable: str, code: int) -> Value:
    """Return the user's value for a variable's code, or the code itself if the team has no such variable."""
    return value_of(model, variable, code) if variable in model.variables else code


def labels_of(model: Model) -> dict[str, str]:
    """Return the user's values that are spelled differently in files: `two words` by `two_words`."""
    found: dict[str, str] = {}
    for name, variable in model.team.variables.items():
        if not variable.domain.symbols or name not in model.variables:
            continue
        for code in variable.domain:
            label, value = str(variable.domain.label(code)), str(value_of(model, name, code))
            if label != value:
                found[label] = value
    return found


def called_in(model: Model, sketch: Sketch) -> Callable[[str, int], str]:
    """Return a function that converts a variable's code to a short text for the user: a cell to `(2, 3)`."""
    decisions = {f"{robot}.{one.name}": one for one in sketch.decisions for robot in sketch.deciders(one)}

    def called(variable: str, code: int) -> str:
        if variable not in model.variables:
            return str(code)
        value, decision = value_of(model, variable, code), decisions.get(variable)
        return value_in_short(sketch, decision, value) if decision else str(value)

    return called
