"""A user's own protocol (docs/tutorials/write-a-protocol.md): installed as a user does, found, run, tested; failures.

Packages go into folders of their own, which stand on PYTHONPATH: nothing is downloaded, and neither the repository nor
the environment changes.
"""

from __future__ import annotations

import csv
import io
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import fields
from pathlib import Path

import pytest

from robochoc.experiments.digests import digest_of_protocol
from robochoc.experiments.plan import plan_of
from robochoc.journal.journal import read_journal
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import Traits
from robochoc.run.registry import UnknownProtocolError, protocol_named, protocol_names
from robochoc.sniffer.page_data import PageData
from robochoc.sniffer.trace import Trace
from robochoc.solver.agent_problem import agent_problems
from robochoc.solver.local_problem import LocalProblem
from tests.support import golden
from tests.support.limits import HANG_S
from tests.support.problems import team_of
from tests.support.program import ROOT, robochoc_within
from tests.support.studies import study

EXAMPLE = ROOT / "docs" / "examples" / "breakout"
GUIDE = (ROOT / "docs" / "tutorials" / "write-a-protocol.md").read_text()
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", GUIDE, re.MULTILINE | re.DOTALL)
COMMANDS = [place for place, (kind, _) in enumerate(BLOCKS) if kind == "sh"]
INSTALL = "pip install docs/examples/breakout"
SUFFIXES = {"python": ".py", "toml": ".toml"}
LONG = "pytest tests/conformance/"
"""A command that begins so is run by `make test-slow`: the suite itself has its place in `make test`."""
SCOUTS = str(ROOT / "docs" / "examples" / "scouts")


def environment(*packages: Path, **more: str) -> dict[str, str]:
    """The shell's, with this Python's programs and `packages` to be found first."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    found = [str(folder) for folder in packages]
    return {
        **kept,
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), kept["PATH"]]),
        "PYTHONPATH": os.pathsep.join([*found, *filter(None, [kept.get("PYTHONPATH")])]),
        "PYTHONDONTWRITEBYTECODE": "1",
        "PYTEST_ADDOPTS": "-p no:cacheprovider",
        **more,
    }


def run(command: str, environ: Mapping[str, str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["sh", "-c", command], cwd=ROOT, env=environ, capture_output=True, text=True, timeout=HANG_S, check=False
    )


def files() -> set[Path]:
    return {path for path in EXAMPLE.rglob("*") if "__pycache__" not in path.parts}


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment in which the guide's package is installed, by the guide's own command."""
    target = tmp_path_factory.mktemp("packages")
    # What pip is not told on its command line it reads from its environment; "0" means without isolation.
    offline = {"PIP_TARGET": str(target), "PIP_NO_DEPS": "1", "PIP_NO_INDEX": "1", "PIP_NO_BUILD_ISOLATION": "0"}
    before = files()
    done = run(INSTALL, environment(**offline))
    assert done.returncode == 0, done.stderr
    assert files() == before
    return environment(target, HYPOTHESIS_STORAGE_DIRECTORY=str(target / "hypothesis"))


def forget_modules(folder: Path) -> None:
    """What was imported from there is imported anew, or not found, by whoever comes next."""
    for name, module in [*sys.modules.items()]:
        if Path(getattr(module, "__file__", None) or "/").is_relative_to(folder):
            del sys.modules[name]


# The guide


@pytest.mark.parametrize(
    "place",
    [
        pytest.param(place, marks=pytest.mark.slow if BLOCKS[place][1].startswith(LONG) else pytest.mark.more)
        for place in COMMANDS
    ],
    ids=lambda place: BLOCKS[place][1].splitlines()[0],
)
def test_the_guides_commands_do_what_it_says(place: int, installed: dict[str, str]) -> None:
    """Each line ends with status 0, unless it says otherwise; a text after the commands is what they print."""
    printed = ""
    for line in BLOCKS[place][1].splitlines():
        if line == INSTALL:
            continue
        done = run(line, installed)
        said = re.search(r"# exit status (\d)$", line)
        assert done.returncode == int(said[1] if said else 0), done.stdout + done.stderr
        printed += done.stdout
    kind, text = BLOCKS[place + 1] if place + 1 < len(BLOCKS) else ("", "")
    if kind == "text":
        assert _without_seconds(printed) == _without_seconds(text)


def test_the_guide_installs_and_its_own_tests_and_the_conformance_suite_are_among_its_commands() -> None:
    said = "".join(BLOCKS[place][1] for place in COMMANDS)
    assert INSTALL in said
    assert "pytest docs/examples/breakout" in said
    assert "pytest tests/conformance/test_conformance.py" in said


def test_the_guides_code_is_the_examples() -> None:
    sources = {kind: [path.read_text() for path in EXAMPLE.rglob(f"*{end}")] for kind, end in SUFFIXES.items()}
    for kind, text in BLOCKS:
        if kind not in {"sh", "text"}:
            assert any(text in source for source in sources[kind]), text


def test_the_guide_explains_every_trait_and_all_that_a_robot_knows() -> None:
    problem = LocalProblem(agent_problems(team_of({"A": (1,)}, []))["RA"])
    assert _explained("trait") == {field.name for field in fields(Traits)}
    assert _explained("member") == {name for name in dir(problem) if not name.startswith("_")}


def test_the_guide_names_what_a_protocol_has() -> None:
    said = _explained("you write") | _explained("you use")
    has = {*dir(Protocol), "value", "verdict", "problem", "order", "chance", "secret"}
    assert said == {name for name in has if not name.startswith("_")} - {"messages", "traits", "assignment"}


def test_the_guides_links_lead_somewhere() -> None:
    links = re.findall(r"\]\(([^)]+)\)", GUIDE)
    assert links
    assert all((ROOT / "docs" / "tutorials" / link.partition("#")[0]).exists() for link in links)
    assert "(write-a-protocol.md)" in (ROOT / "docs" / "tutorials" / "index.md").read_text()


def _explained(head: str) -> set[str]:
    """The names in the first column of the table whose first column is headed `head`."""
    (table,) = re.findall(rf"^\| {head} \|.*\n\|.*\n((?:\|.*\n)+)", GUIDE, re.MULTILINE)
    return {name for row in table.splitlines() for name in re.findall(r"`(\w+)`", row.split("|")[1])}


def _without_seconds(text: str) -> str:
    return re.sub(r"\d+\.\d+ s\b", "some s", text)


# Its messages, where others look at them


def exported(form: str, journal: Path) -> str:
    done = robochoc_within("journal", "export", journal, "--format", form)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_its_words_and_acts_are_in_the_sniffer_and_the_exports(here: Path, tmp_path: Path) -> None:
    module = "robochoc_breakout"
    package(here, module, {"breakout": f"{module}:Breakout"}, (EXAMPLE / f"{module}.py").read_text())
    journal = tmp_path / "breakout.journal"
    done = solved("--protocol", "breakout", "--runtime", "simulator", "--journal", str(journal))
    assert done.returncode == 0
    assert any(
        _without_seconds(done.stdout).endswith(_without_seconds(text)) for kind, text in BLOCKS if kind == "text"
    )
    ok, improve = "V1 = 1 in this wave", "I have 0 weighted violations, and could do with 0 less"
    rows = list(csv.DictReader(io.StringIO(exported("csv", journal))))
    assert {row["type"]: row["performative"] for row in rows} == {"Ok": "inform", "Improve": "propose"}
    assert {f"Scout says: {ok}", f"Scout says: {improve}"} <= {row["words"] for row in rows}
    acl = exported("acl", journal)
    assert acl.count("(PROPOSE ") == sum(row["type"] == "Improve" for row in rows)
    assert acl.count("(INFORM ") == sum(row["type"] == "Ok" for row in rows)
    feed = PageData(Trace.of(read_journal(journal.read_bytes())))
    about, details = json.loads(feed.about()), json.loads(feed.details(0))
    (improved,) = [kind for kind in about["kinds"] if kind["name"] == "Improve"]
    assert improved["performative"] == "propose"
    assert improved["why"] == "the neighbour with the largest improvement moves"
    assert next(one["words"] for one in details if "V1" in one["words"]) == f"Scout says: {ok}"


# What may go wrong

SILENT = """
from robochoc.protocols.message import Message
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.traits import Traits

class Silent(Protocol):
    messages = Message
    traits = Traits(complete=False)
    def start(self):
        self.value = 0
    def receive(self, sender, message):
        pass

class Raises(Silent):
    def start(self):
        raise ValueError("out of ideas")

"""


def package(folder: Path, name: str, offers: Mapping[str, str], code: str = SILENT) -> Path:
    """A package as an installer leaves it, with one module of its name; `offers` maps protocols to places."""
    entries = "\n".join(f"{protocol} = {place}" for protocol, place in offers.items())
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[robochoc.protocols]\n{entries}\n")
    (folder / f"{name}.py").write_text(code)
    return folder


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder for packages, in which this process looks too."""
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    forget_modules(tmp_path)


def solved(*words: str) -> subprocess.CompletedProcess[str]:
    return robochoc_within("solve", SCOUTS, *words)


@pytest.mark.parametrize("code", ["raise RuntimeError('no')", "raise SystemExit"])
def test_a_module_that_cannot_be_imported_is_said_in_one_line(code: str, here: Path) -> None:
    """And other protocols are not concerned."""
    package(here, "mine", {"own": "mine:Silent"}, code)
    done = solved("--protocol", "own")
    assert done.returncode == 2
    assert f"{SCOUTS}: mine:Silent, installed as protocol 'own', cannot be imported: " in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert solved("--runtime", "simulator").returncode == 0


def test_a_name_that_two_packages_offer_is_refused(here: Path) -> None:
    package(here, "mine", {"own": "mine:Silent", "abt": "mine:Silent"})
    package(here, "yours", {"own": "yours:Silent"})
    with pytest.raises(
        UnknownProtocolError, match=r"'own', is offered by several packages: mine:Silent \(mine\) and yours:"
    ):
        protocol_named("own")
    assert list(protocol_names()).count("own") == 1
    done = solved("--protocol", "abt")
    assert done.returncode == 2
    assert "installed as protocol 'abt', is offered by several packages" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_package_that_comes_and_goes_meanwhile_is_there_and_gone(here: Path) -> None:
    before = protocol_names()
    package(here, "mine", {"own": "mine:Silent"})
    assert {*protocol_names()} == {*before, "own"}
    shutil.rmtree(here / "mine-1.0.dist-info")
    assert protocol_names() == before


def test_a_package_on_the_path_twice_is_one_package(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As when a folder that is being worked on stands before what is installed."""
    for folder in ("first", "second"):
        monkeypatch.syspath_prepend(package(here / folder, "mine", {"own": "mine:Silent"}))
    assert protocol_named("own").__name__ == "Silent"


def test_what_is_installed_beside_ours_is_tested_but_has_no_golden_journals(here: Path) -> None:
    ours = golden.files()
    package(here, "mine", {"own": "mine:Silent"})
    golden.files.cache_clear()
    assert "own" in protocol_names()
    assert golden.files() == ours


def test_a_study_repeats_the_runs_of_a_protocol_whose_files_have_changed(here: Path) -> None:
    text = '[problems]\nfamily = "random"\nagents = 4\ndomain = 3\n[runs]\nprotocol = ["abt", "own"]\n'
    package(here, "mine", {"own": "mine:Silent"})
    before = {task.setup.protocol: key for key, task in plan_of(study(text)).items()}
    assert {task.setup.protocol: key for key, task in plan_of(study(text)).items()} == before
    (here / "mine.py").write_text(f"{SILENT}# changed\n")
    after = {task.setup.protocol: key for key, task in plan_of(study(text)).items()}
    assert after["abt"] == before["abt"]
    assert after["own"] != before["own"]


def test_all_files_of_a_protocols_package_count(here: Path) -> None:
    package(here, "mine", {"own": "mine.own:Silent"})
    (here / "mine.py").unlink()
    (here / "mine").mkdir()
    for name, code in (("__init__", ""), ("own", SILENT), ("help", "P = 0.98\n")):
        (here / "mine" / f"{name}.py").write_text(code)
    before = digest_of_protocol(protocol_named("own"))
    (here / "mine" / "help.py").write_text("P = 0.90\n")
    assert digest_of_protocol(protocol_named("own")) != before
    assert digest_of_protocol(protocol_named("abt")) == ""


@pytest.mark.parametrize("runtime", ["processes", "simulator"])
def test_a_wrong_solution_is_refuted(runtime: str, here: Path) -> None:
    package(here, "mine", {"own": "mine:Silent"})
    done = solved("--protocol", "own", "--runtime", runtime)
    assert done.returncode == 4
    assert "the checker refutes the answer for scouts" in done.stderr


def test_an_exception_is_told_with_its_place(here: Path) -> None:
    package(here, "mine", {"own": "mine:Raises"})
    done = solved("--protocol", "own")
    assert done.returncode == 4
    assert re.search(r"was lost: ValueError: out of ideas \(.*mine\.py:\d+\)", done.stderr)
    with pytest.raises(ValueError, match="out of ideas"):
        solved("--protocol", "own", "--runtime", "simulator")


@pytest.mark.more
def test_in_the_simulator_an_exception_is_told_with_its_traceback(tmp_path: Path) -> None:
    package(tmp_path, "mine", {"own": "mine:Raises"})
    done = run(f"robochoc solve {SCOUTS} --protocol own --runtime simulator", environment(tmp_path))
    assert "Traceback" in done.stderr
    assert "ValueError: out of ideas" in done.stderr
