"""What a run decides, made ready for its process: the team's files in the run's folder, and the words for values."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from robochoc.app.foreign.facts import domains_of
from robochoc.app.runs.labels import called_in, label_of, labels_of
from robochoc.app.runs.run import Run
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.sketch import Sketch, Value
from robochoc.formats import read_team, write_team
from robochoc.model.problem import AddAgent, Change, Domain, Robot, ScenarioEvent, Team
from robochoc.modelling.model import Model


@dataclass(frozen=True)
class Prepared:
    """A team that is ready to decide.

    Attributes:
        team: The team.
        label: Returns the user's value that a code of a variable stands for.
        labels: The user's values that files say otherwise, by what files say.
        called: Returns the user's value in short, as it stands in what robots say.
    """

    team: Team
    label: Callable[[str, int], Value]
    labels: dict[str, str]
    called: Callable[[str, int], str]

    @property
    def robots(self) -> list[str]:
        """The names of all robots, those that join included."""
        return [robot.name for robot in _robots(self.team)]


@dataclass(frozen=True)
class TeamFiles:
    """The files of a team that was not drawn here.

    Attributes:
        folder: Where they are.
        flies: Whether its decisions say where robots are to be.
        maximised: Whether the sum of its costs is a worth, and to be as large as can be.
        then: What happens to the team once it has decided all that its files ask for.
    """

    folder: Path
    flies: bool = True
    maximised: bool = False
    then: tuple[Change, ...] = ()


def from_sketch(run: Run, model: Callable[[Sketch], Model]) -> Prepared:
    """Write the files of a run's sketch, of which `model` makes a model. Raises what that raises, or `OSError`."""
    made = model(run.sketch)
    made.save(run.team)
    return _drawn(made, run.sketch)


def from_files(run: Run, files: TeamFiles) -> Prepared:
    """Write the files of a run's team, as they are or with what happens to it. Raises `InvalidInputError`, `OSError`.

    Values are told as files say them.
    """
    team = read_team(files.folder)
    if files.then:
        team = replace(team, scenario=(*team.scenario, ScenarioEvent(files.then)))
        write_team(team, run.team)
    else:
        shutil.copytree(files.folder, run.team)
    return _found(team)


def from_before(run: Run) -> Prepared:
    """Return what a run had decided, from its folder. Raises what `from_sketch` and `from_files` raise."""
    if run.record.flies is not None:  # it was not drawn here
        return _found(read_team(run.team))
    return _drawn(model_of(run.sketch), run.sketch)


def _robots(team: Team) -> tuple[Robot, ...]:
    joining = (change.robot for event in team.scenario for change in event.changes if isinstance(change, AddAgent))
    return (*team.robots, *joining)


def _drawn(model: Model, sketch: Sketch) -> Prepared:
    return Prepared(model.team, partial(label_of, model), labels_of(model), called_in(model, sketch))


def _found(team: Team) -> Prepared:
    domains = domains_of(team)
    return Prepared(team, partial(_label, domains), {}, lambda name, code: str(_label(domains, name, code)))


def _label(domains: Mapping[str, Domain], name: str, code: int) -> Value:
    return domains[name].label(code) if name in domains else code
