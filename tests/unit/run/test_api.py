"""robochoc as a library: `load(path).solve()`, and the paper's containers (Figures 3 and 4)."""

from __future__ import annotations

import doctest
import subprocess
import sys
from decimal import Decimal
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import robochoc
from robochoc import api
from robochoc.api import protocol_called
from robochoc.formats import InvalidInputError, write_team
from robochoc.generators import queens3d, random_csp
from robochoc.journal.events import AnyEvent, Concluded
from robochoc.model.outcome import Outcome, Verdict
from robochoc.run.networked.address import AddressError
from robochoc.run.registry import UnknownProtocolError, installed_protocols
from robochoc.solver.errors import UnsupportedError
from tests.support.cases import cases
from tests.support.deployments import Deployment
from tests.support.problems import team_of
from tests.support.program import ROOT
from tests.support.small_teams import differ

FOUR = ROOT / "instances" / "queens3d-4"
SCOUTS = ROOT / "docs" / "examples" / "scouts"
PAIR = team_of(dict.fromkeys("AB", range(1, 3)), [differ("A", "B")])
COSTS = """<instance>
  <presentation type="DisWCSP"/>
  <domains><domain name="D">1..3</domain></domains>
  <variables><variable name="V" domain="D"/></variables>
  <agents_neighbours><agents_parent/><agents_children/></agents_neighbours>
</instance>
"""


# On this machine


def test_load_and_solve() -> None:
    outcome = robochoc.load(str(FOUR)).solve(runtime="simulator")
    assert isinstance(outcome, robochoc.Outcome)
    assert outcome.verdict is robochoc.Verdict.NO_SOLUTION
    assert (outcome.protocol, outcome.runtime, outcome.assignment) == ("sfb", "simulator", {})
    assert list(outcome.chosen) == ["protocol", "order"]


def test_the_simulator_if_nothing_is_said() -> None:
    outcome = robochoc.load(SCOUTS).solve()
    assert (outcome.verdict, outcome.runtime, outcome.verified) == (Verdict.SOLUTION, "simulator", True)
    assert outcome.assignment.keys() == {"V1", "V2", "V3"}


def test_options_are_those_of_the_command_line() -> None:
    told: list[AnyEvent] = []
    problem = robochoc.load(FOUR)
    outcome = problem.solve(
        "afc-ng", "simulator", order="random", withdraw="minimum", seed=3, delay=5, observer=told.append
    )
    assert (outcome.verdict, outcome.protocol, outcome.seed) == (Verdict.OPTIMAL, "afc-ng", 3)
    assert len(outcome.withdrawn_alive) == 6
    assert any(isinstance(event, Concluded) for event in told)
    stopped = problem.solve("dsa", "simulator", settings={"cycles": 7, "variant": "C"})
    assert stopped.verdict is Verdict.UNKNOWN
    assert problem.solve("abt", "simulator", messages=10).verdict is Verdict.UNKNOWN


def test_the_protocol_that_suits_costs(tmp_path: Path) -> None:
    (tmp_path / "A.xml").write_text(COSTS)
    outcome = robochoc.load(tmp_path).solve(runtime="simulator")
    assert (outcome.verdict, outcome.protocol) == (Verdict.OPTIMAL, "sfb")


NO_OPTIONS: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"protocol": "nonsense"}, UnknownProtocolError, "nonsense"),
    ({"runtime": "clouds"}, ValueError, "clouds"),
    ({"order": "clouds"}, ValueError, "clouds"),
    ({"withdraw": "clouds"}, ValueError, "clouds"),
    ({"colour": "red"}, TypeError, "colour"),
    ({"settings": {"colour": "red"}}, UnsupportedError, "colour"),
]


def test_what_is_no_option() -> None:
    with cases() as each:
        for options, error, told in NO_OPTIONS:
            with each(options):
                problem = robochoc.load(SCOUTS)
                with pytest.raises(error, match=told):
                    problem.solve(**{"runtime": "simulator", **options})


def test_what_is_no_team(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="nowhere"):
        robochoc.load(tmp_path / "nowhere")
    (tmp_path / "A.xml").write_text(COSTS.replace("1..3", "3..1"))
    with pytest.raises(InvalidInputError, match=r"A\.xml:3"):
        robochoc.load(tmp_path)


def test_what_the_package_offers() -> None:
    assert {"AgentsContainer", "Outcome", "Problem", "Verdict", "load"} <= set(robochoc.__all__)
    assert all(getattr(robochoc, name) is not None for name in robochoc.__all__)
    assert robochoc.Outcome is Outcome
    with pytest.raises(AttributeError, match="nothing"):
        _ = robochoc.nothing


def test_the_library_comes_when_it_is_asked_for() -> None:
    words = "import sys, robochoc; before = {'msgspec', 'lxml'} & set(sys.modules); robochoc.load; print(before)"
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout == "set()\n"


# Containers


def test_protocols_as_the_paper_calls_them() -> None:
    for word, name in [("ABT", "abt"), ("abt", "abt"), ("AFCng", "afc-ng"), ("afc-ng", "afc-ng"), ("MaxSum", "maxsum")]:
        assert protocol_called(word) == name


def test_every_protocol_has_a_class_that_names_it() -> None:
    named = [(offer.name, offer.protocol.__name__) for offer in installed_protocols() if offer.protocol]
    words = [{name.casefold(), kind.casefold()} for name, kind in named]
    assert sum(map(len, words)) == len(set().union(*words))


def test_protocols_that_nobody_knows() -> None:
    for word in ["", "XYZ", "ABT "]:
        with pytest.raises(UnknownProtocolError, match="robochoc protocols"):
            protocol_called(word)


def test_containers_that_were_not_told_all(tmp_path: Path) -> None:
    container = robochoc.AgentsContainer()
    with pytest.raises(ValueError, match="set_agent_type"):
        container.run()
    with pytest.raises(ValueError, match="'RobotABT' is not a type of agent"):
        container.set_agent_type("RobotABT")
    with pytest.raises(UnknownProtocolError):
        container.set_agent_type("AgentXYZ")
    with pytest.raises(AddressError, match="HOST:PORT"):
        container.set_main_container("no where")
    container.set_agent_type("AgentABT")
    with pytest.raises(ValueError, match="set_main_container"):
        container.run()
    container.set_main_container("127.0.0.1")
    with pytest.raises(ValueError, match="add_agent"):
        container.run()
    container.add_agent("Robot3.1", tmp_path / "Robot3.2.xml")
    with pytest.raises(ValueError, match=r"the file of Robot3\.1 must be called Robot3\.1\.xml"):
        container.run()


MASTER = """
from robochoc import AgentsContainer
from robochoc.communication.network.settings import NetworkSettings

main_container = AgentsContainer()
main_container.set_agent_type("MasterABT")
main_container.add_agent("MASTER", sniff=False)
{settings}
events = []
outcome = main_container.run(observer=events.append, gather_s=600, conditions=NetworkSettings(patience_s=600))
print(outcome.verdict, outcome.protocol, dict(sorted(outcome.assignment.items())), outcome.verified)
print(*sorted({{event.sender for event in events if type(event).__name__ == "Sent"}}))
"""
ROBOT = """
from robochoc import AgentsContainer
from robochoc.run.networked import join

join.PATIENCE_S = 600  # however long the master takes to start
join.identity_of.__defaults__ = (None, None, join.PATIENCE_S)
container = AgentsContainer()
container.set_agent_type("AgentABT")
{agents}
container.set_main_container("{place}")
{settings}
for name, ending in container.run().items():
    print(name, ending.why, ending.assignment)
"""


@pytest.mark.more
def test_figures_3_and_4(site: Deployment) -> None:
    files = site.folder / "files"
    write_team(PAIR, files)
    tokens = site.enrol("--team", files)
    settings = f'main_container.set_listen("{site.place}")\nmain_container.set_authority("{site.authority_folder}")'
    robots = {
        name: ROBOT.format(
            agents=f'container.add_agent("{name}", "{files / name}.xml", sniff={name == "RA"})',
            place=site.place,
            settings=f'container.set_identity("{name}", token="{token}")',
        )
        for name, token in tokens.items()
    }
    first = site.script("RA", robots["RA"])  # before its master
    master = site.script("master", MASTER.format(settings=settings))
    second = site.script("RB", robots["RB"])
    assert master.status() == 0, master.errors
    assert (first.status(), second.status()) == (0, 0), (first.errors, second.errors)
    verdict, sniffed = master.output.splitlines()
    decided = [text.output.rpartition("solution ")[2].strip() for text in (first, second)]
    assert sorted(decided) in (["{'A': 1}", "{'B': 2}"], ["{'A': 2}", "{'B': 1}"])
    assert verdict.startswith("solution abt {'A': ")
    assert verdict.endswith(" True")
    assert sniffed == "RA"


def test_one_container_holds_several_robots(site: Deployment) -> None:
    tokens = site.enrol("--team", SCOUTS)
    settings = f'main_container.set_listen("{site.place}")\nmain_container.set_authority("{site.authority_folder}")'
    robots = ROBOT.format(
        agents="\n".join(f'container.add_agent("{name}", "{SCOUTS / name}.xml", sniff=True)' for name in tokens),
        place=site.place,
        settings="\n".join(f'container.set_identity("{name}", token="{token}")' for name, token in tokens.items()),
    )
    container = site.script("field", robots)
    master = site.script("master", MASTER.format(settings=settings).replace("MasterABT", "MasterAFCng"))
    assert (master.status(), container.status()) == (0, 0), (master.errors, container.errors)
    verdict, sniffed = master.output.splitlines()
    assert verdict.startswith("solution afc-ng {'V1': ")
    assert sniffed == "Base Relay Scout"
    assert [line.split()[:2] for line in container.output.splitlines()] == [[name, "solution"] for name in tokens]


@pytest.mark.parametrize("module", [robochoc, api, queens3d, random_csp])
def test_examples_in_docstrings_run(module: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    attempted = doctest.testmod(module)
    assert attempted.attempted > 0
    assert attempted.failed == 0


COLOURING = """name: colouring
objective: min
domains: {colours: {values: [red, green]}}
variables: {_x1: {domain: colours}, _x2: {domain: colours}}
constraints:
  same: {type: intention, function: 1000 if _x1 == _x2 else 0.5}
agents: [a1, a2]
"""


def test_a_file_of_another_tool_speaks_in_its_own_names(tmp_path: Path) -> None:
    file = tmp_path / "colouring.yaml"
    file.write_text(COLOURING)
    problem = robochoc.load(file, infinity=1000)
    solution = problem.solve("syncbb", runtime="simulator")
    assert solution.cost == Decimal("0.5")
    assert solution.values.keys() == {"_x1", "_x2"}
    assert set(solution.values.values()) == {"red", "green"}
    assert solution["_x1"] in {"red", "green"}


def test_the_format_of_a_file_and_its_code_are_allowed_by_arguments(tmp_path: Path) -> None:
    text = COLOURING.replace("function: 1000", "source: outside.py, function: source.large()").replace("0.5", "2")
    (tmp_path / "outside.py").write_text("def large():\n    return 1000\n")
    file = tmp_path / "colouring.txt"
    file.write_text(text)
    with pytest.raises(InvalidInputError, match="allow_code=True if you trust"):
        robochoc.load(file, format="pydcop")
    with pytest.raises(InvalidInputError, match="unknown format"):
        robochoc.load(file, format="nope", allow_code=True)
    assert robochoc.load(file, format="pydcop", allow_code=True).solve("syncbb").cost == 2
