"""`robochoc generate`: each family writes what its function makes; options that do not fit are wrong usage."""

from __future__ import annotations

import json
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import pytest

from robochoc.cli.options.generate import next_step
from robochoc.cli.reports.failures import INVALID
from robochoc.formats import read_team
from robochoc.generators.coloring import coloring_of
from robochoc.generators.frequencies import frequencies
from robochoc.generators.graphs import grid, scale_free, small_world, tree
from robochoc.generators.heights import heights
from robochoc.generators.ising import ising
from robochoc.generators.maps.coverage import coverage
from robochoc.generators.maps.formation import formation
from robochoc.generators.maps.map_team import MapChoice
from robochoc.generators.maps.patrol import patrol
from robochoc.generators.meetings import meetings
from robochoc.generators.nary import nary
from robochoc.generators.random_csp import random_on
from robochoc.generators.sensors import Reach, grid_sensors, sensors
from robochoc.generators.smart_homes import smart_homes
from robochoc.generators.stochastic import stochastic
from robochoc.generators.swarm import swarm
from robochoc.generators.tasks import Skills, Travel, tasks
from robochoc.generators.tracking import tracking
from robochoc.maps.occupancy.grid import read_occupancy_grid
from robochoc.maps.octomap.voxels import read_voxels
from robochoc.maps.reachability.cells import Cells, Cubes
from robochoc.maps.reachability.free_space import free_space
from robochoc.model.allocation import Distance
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import Team
from tests.support.cases import cases
from tests.support.evaluation import best
from tests.support.program import ROOT, robochoc_within

BUILDING = str(ROOT / "docs/examples/building/building.yaml")
HOUSE = str(ROOT / "docs/examples/house/house.bt")
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
    "nary --agents 5 --domain 2 --constraints 4 --max-cost 9": lambda: nary(
        agents=5, domain=2, constraints=4, max_cost=9
    ),
    "stochastic --agents 5 --domain 3 --observed 0.5": lambda: stochastic(agents=5, domain=3, observed=0.5),
    "swarm --agents 3 --side 6 --points 5 --seed 2": lambda: swarm(agents=3, side=6, points=5, seed=2),
    "frequencies --agents 5 --frequencies 3": lambda: frequencies(agents=5, frequencies=3),
    "heights --agents 4 --levels 3": lambda: heights(agents=4, levels=3),
    "smart-homes --agents 4 --rules 3 --levels 3": lambda: smart_homes(agents=4, rules=3, levels=3),
    "meetings --agents 3 --meetings 2 --slots 3 --max-length 2": lambda: meetings(3, 2, 2, 3, max_length=2),
    "meetings --agents 3 --meetings 2 --slots 3 --required": lambda: meetings(3, 2, 2, 3, max_value=None),
    "sensors --sensors 6 --targets 2 --needed 1": lambda: sensors(6, 2, needed=1),
    "grid-sensors --rows 2 --columns 3 --targets 2 --sight 2 --model sensors": lambda: grid_sensors(
        2, 3, 2, reach=Reach(sight=2), model="sensors"
    ),
    "tracking --agents 3 --targets 4 --side 5": lambda: tracking(3, 4, 5),
    f"coverage --map {BUILDING} --agents 2 --cells 16 --sensing 2 --worth 3.5": lambda: coverage(
        MapChoice(map=BUILDING, agents=2, cells=16), sensing=2, worth=3.5
    )[0],
    f"formation --map {HOUSE} --agents 3 --anchor 2,4.5,3.5 --cells 300 --cell 0.75": lambda: formation(
        MapChoice(map=HOUSE, agents=3, cell=0.75, cells=300), anchor="2,4.5,3.5"
    )[0],
    f"patrol --map {BUILDING} --agents 2 --points 5 --idle 30 --rounds 2 --apart 4": lambda: patrol(
        MapChoice(map=BUILDING, agents=2), points=5, idle=30, rounds=2, apart=4
    )[0],
    f"formation --map {BUILDING} --agents 3 --shape wedge --anchor 7,2 --within 60 --seed 2": lambda: formation(
        MapChoice(map=BUILDING, agents=3, within=60), 2, shape="wedge", anchor="7,2"
    )[0],
    "tasks --agents 3 --tasks 3 --distance straight --places 2 --skills 2 --worth 100": lambda: tasks(
        3, 3, worth=100, travel=Travel(100, Distance.STRAIGHT, 2), skills=Skills(2, 1)
    ),
}


def test_very_many_robots_are_not_proposed_as_processes() -> None:
    assert next_step("out", 1000) == "next: robochoc solve out"
    assert next_step("out", 1001) == "next: robochoc solve out --runtime simulator"


@pytest.mark.usefixtures("in_a_folder")
def test_a_family_is_written_under_its_name(tmp_path: Path) -> None:
    """The files mean the same: definitions may have got names of their own."""
    with cases() as each:
        for words, made in FAMILIES.items():
            with each(words):
                team = made()
                done = robochoc_within("generate", *words.split())
                assert (done.returncode, done.stderr) == (0, "")
                folder = Path("instances") / team.name
                assert f"; next: robochoc solve {folder}\n" in done.stdout
                read = read_team(tmp_path / folder)
                assert set(read.order) == set(team.order)
                assert read.variables.keys() == team.variables.keys()
                assert best(read) == best(team)


@pytest.mark.usefixtures("in_a_folder")
def test_what_does_not_fit_is_wrong_usage(tmp_path: Path) -> None:
    with cases() as each:
        for words, said in [
            ("random --domain 3 --tightness 0.2", "--agents is missing"),
            ("random --domain 3 --tightness 0.2 --agents 3", "--density is missing"),
            ("random --domain 3 --tightness 0.2 --agents 3 --graph tre", "did you mean 'tree'?"),
            (
                "random --domain 3 --tightness 0.2 --agents 3 --graph tree --density 0.2",
                "--density is for --graph random",
            ),
            (
                "random --domain 3 --tightness 0.2 --agents 3 --graph tree --links 2",
                "--links is for --graph scale-free",
            ),
            (
                "random --domain 3 --tightness 0.2 --agents 3 --graph tree --connected",
                "--connected is for --graph random or",
            ),
            ("random --domain 3 --tightness 0.2 --agents 7 --graph grid --rows 2", "7 robots do not fill 2 rows"),
            ("random --domain 3 --tightness 0.2 --agents 5 --density 0.5 --places 2", "require --max-cost"),
            ("random --domain 3 --tightness 0.2 --agents 5 --density 0.5 --maximize", "require --max-cost"),
            ("random --domain 3 --tightness 0.2 --agents 5 --density 0.5 --asymmetric", "require --max-cost"),
            ("random --domain 3 --tightness 2 --agents 5 --graph tree", "tightness is 2.0"),
            ("coloring --agents 5 --graph small-world --neighbours 3", "must be even"),
            ("meetings --agents 3 --meetings 2 --slots 3 --participants 4", "participants is 4"),
            ("sensors --sensors 3 --targets 2 --visibility 0", "no sensor sees target 1"),
            ("tasks --agents 3 --tasks 2 --skilled 2", "--skilled is 2"),
            ("agentsnet --task coloring --agents 3", "--degree is missing (required for --graph random)"),
            ("agentsnet --task coloring", "--agents is missing"),
            ("smart-grid --agents 3 --slots 3 --duration 4", "--duration is 4, but there are only 3 slots: use more"),
            ("smart-grid --agents 3 --slots 3", "--window is 3, but a device that runs for 3 of the 3 slots can start"),
            (f"formation --map {BUILDING}", "agents is missing: give the number of robots, or their places with at"),
            (
                f"formation --map {BUILDING} --agents 2 --anchor 80,2.5",
                "the anchor 80,2.5 is not on the map, which lies between -0.25,-0.25 and 10.25,6.25",
            ),
            (f"formation --map {HOUSE} --at 4.8,1", "at has '4.8,1'; expected X,Y,Z on a three-dimensional map"),
            (f"formation --map {BUILDING} --at 4.8,1", "robot 1 at 4.8,1 does not fit there"),
        ]:
            with each(words):
                done = robochoc_within("generate", *words.split())
                assert done.returncode == 2
                assert said in done.stderr
                assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("in_a_folder")
def test_a_map_is_written_beside_the_team_and_flown_on(tmp_path: Path) -> None:
    words = ["generate", "formation", "--map", BUILDING, "--agents", "3", "--anchor", "7,2", "-o", "team"]
    done = robochoc_within(*words)
    assert done.stdout.endswith("team/map.json: cells of 0.75 m, and walls that drones fly around\n")
    assert robochoc_within(*words).returncode == INVALID
    assert robochoc_within(*words, "--force").returncode == 0
    solved = robochoc_within("solve", "team", "--runtime", "simulator", "--json")
    (tmp_path / "result.json").write_text(solved.stdout)
    flown = robochoc_within("fly", "result.json", "--team", "team", "--json")
    assert flown.returncode == 0, flown.stderr
    found = json.loads(flown.stdout)
    assert found["scale"] == 0.75
    values = json.loads(solved.stdout)["assignment"]
    grid = read_occupancy_grid(Path(BUILDING))
    cells = Cells(grid, Fraction("0.75"), free_space(grid.free, Fraction(0)))
    for drone in found["drones"]:
        place = cells.centre(values[drone["name"].replace("Robot", "V")])
        assert drone["at"][:2] == pytest.approx([float(one) for one in place], abs=0.05)


@pytest.mark.usefixtures("in_a_folder")
def test_a_house_is_flown_in(tmp_path: Path) -> None:
    words = ("--map", HOUSE, "--at", "2,2,1 6,4,3.5", "--anchor", "2,4.5,3.5", "-o", "team")
    done = robochoc_within("generate", "formation", *words)
    assert done.stdout.endswith("team/map.json: cells of 1 m, and walls that drones fly around\n")
    solved = robochoc_within("solve", "team", "--runtime", "simulator", "--json")
    (tmp_path / "result.json").write_text(solved.stdout)
    flown = robochoc_within("fly", "result.json", "--team", "team", "--json")
    assert flown.returncode == 0, flown.stderr
    ends = {drone["name"]: drone["at"] for drone in json.loads(flown.stdout)["drones"]}
    values = json.loads(solved.stdout)["assignment"]
    grid = read_voxels(Path(HOUSE))
    cells = Cubes(grid, Fraction(1), grid.free)
    for name, end in ends.items():
        place = cells.centre(values[name.replace("Robot", "V")])
        assert end == pytest.approx([float(one) for one in place], abs=0.05)


@pytest.mark.usefixtures("in_a_folder")
def test_a_broken_octomap_is_said_with_its_file_and_place(tmp_path: Path) -> None:
    (tmp_path / "plan.bt").write_bytes(Path(HOUSE).read_bytes()[:1000])
    done = robochoc_within("generate", "coverage", "--map", "plan.bt", "--agents", "3")
    assert (done.returncode, done.stdout) == (INVALID, "")
    assert done.stderr.startswith("plan.bt: ends after ")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.usefixtures("in_a_folder")
def test_what_is_no_map_is_said_with_its_file_and_line(tmp_path: Path) -> None:
    (tmp_path / "plan.yaml").write_text("image: plan.pgm\nresolution: none\n")
    done = robochoc_within("generate", "formation", "--map", "plan.yaml", "--agents", "3")
    assert (done.returncode, done.stdout) == (INVALID, "")
    assert done.stderr.startswith("plan.yaml:1: the map has no origin")
