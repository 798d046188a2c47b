"""`robochoc generate`: each family writes what its function makes; options that do not fit are wrong usage."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from robochoc.cli.options.generated import next_step
from robochoc.formats import read_team
from robochoc.generators.coloring import coloring_of
from robochoc.generators.graphs import grid, scale_free, small_world, tree
from robochoc.generators.ising import ising
from robochoc.generators.meetings import meetings
from robochoc.generators.random_csp import random_on
from robochoc.generators.sensors import Reach, grid_sensors, sensors
from robochoc.generators.tasks import Skills, Ways, tasks
from robochoc.generators.tracking import tracking
from robochoc.model.allocation import Distance
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import Team
from tests.support.evaluation import best
from tests.support.program import robochoc_within

FAMILIES: dict[str, Callable[[], Team]] = {
    "random --agents 6 --domain 3 --graph scale-free --links 3 --max-cost 9 --places 2 --maximize": lambda: random_on(
        scale_free(6, 3), 3, 0, max_cost=9, costs=CostUnits(maximize=True, places=2)
    ),
    "random --agents 6 --domain 3 --graph tree --max-cost 9 --asymmetric --tightness 0.3": lambda: random_on(
        tree(6), 3, 0.3, max_cost=9, asymmetric=True
    ),
    "random --agents 6 --domain 3 --graph grid --torus --tightness 0.3": lambda: random_on(
        grid(2, 3, torus=True), 3, 0.3
    ),
    "coloring --agents 6 --graph small-world --rewiring 0 --neighbours 2 --conflicts weighted --places 1": lambda: (
        coloring_of(small_world(6, 2, 0), 3, conflicts="weighted", places=1)
    ),
    "ising --rows 2 --columns 3 --seed 4": lambda: ising(2, 3, 4),
    "meetings --agents 3 --meetings 2 --slots 3 --max-length 2": lambda: meetings(3, 2, 2, 3, max_length=2),
    "meetings --agents 3 --meetings 2 --slots 3 --required": lambda: meetings(3, 2, 2, 3, max_value=None),
    "sensors --sensors 6 --targets 2 --needed 1": lambda: sensors(6, 2, needed=1),
    "grid-sensors --rows 2 --columns 3 --targets 2 --sight 2 --model sensors": lambda: grid_sensors(
        2, 3, 2, reach=Reach(sight=2), model="sensors"
    ),
    "tracking --agents 3 --targets 4 --side 5": lambda: tracking(3, 4, 5),
    "tasks --agents 3 --tasks 3 --distance straight --places 2 --skills 2 --worth 100": lambda: tasks(
        3, 3, worth=100, ways=Ways(100, Distance.STRAIGHT, 2), skills=Skills(2, 1)
    ),
}


def test_very_many_robots_are_not_proposed_as_processes() -> None:
    assert next_step("out", 1000) == "next: robochoc solve out"
    assert next_step("out", 1001) == "next: robochoc solve out --runtime simulator"


@pytest.mark.parametrize("words", FAMILIES)
@pytest.mark.usefixtures("in_a_folder")
def test_a_family_is_written_under_its_name(words: str, tmp_path: Path) -> None:
    """The files mean the same: definitions may have got names of their own."""
    team = FAMILIES[words]()
    done = robochoc_within("generate", *words.split())
    assert (done.returncode, done.stderr) == (0, "")
    folder = Path("instances") / team.name
    assert done.stdout.endswith(f"; next: robochoc solve {folder}\n")
    read = read_team(tmp_path / folder)
    assert set(read.order) == set(team.order)
    assert read.variables.keys() == team.variables.keys()
    assert best(read) == best(team)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("random --domain 3 --tightness 0.2", "--agents is missing"),
        ("random --domain 3 --tightness 0.2 --agents 3", "--density is missing"),
        ("random --domain 3 --tightness 0.2 --agents 3 --graph tre", "did you mean 'tree'?"),
        ("random --domain 3 --tightness 0.2 --agents 3 --graph tree --density 0.2", "--density is for --graph random"),
        ("random --domain 3 --tightness 0.2 --agents 3 --graph tree --links 2", "--links is for --graph scale-free"),
        (
            "random --domain 3 --tightness 0.2 --agents 3 --graph tree --connected",
            "--connected is for --graph random or",
        ),
        ("random --domain 3 --tightness 0.2 --agents 7 --graph grid --rows 2", "7 robots do not fill 2 rows"),
        ("random --domain 3 --tightness 0.2 --agents 5 --density 0.5 --places 2", "give --max-cost, too"),
        ("random --domain 3 --tightness 0.2 --agents 5 --density 0.5 --maximize", "give --max-cost, too"),
        ("random --domain 3 --tightness 0.2 --agents 5 --density 0.5 --asymmetric", "give --max-cost, too"),
        ("random --domain 3 --tightness 2 --agents 5 --graph tree", "tightness is 2.0"),
        ("coloring --agents 5 --graph small-world --neighbours 3", "must be even"),
        ("meetings --agents 3 --meetings 2 --slots 3 --participants 4", "participants is 4"),
        ("sensors --sensors 3 --targets 2 --visibility 0", "no sensor sees target 1"),
        ("tasks --agents 3 --tasks 2 --skilled 2", "skilled is 2"),
    ],
)
@pytest.mark.usefixtures("in_a_folder")
def test_what_does_not_fit_is_wrong_usage(words: str, said: str, tmp_path: Path) -> None:
    done = robochoc_within("generate", *words.split())
    assert done.returncode == 2
    assert said in done.stderr
    assert not list(tmp_path.iterdir())
