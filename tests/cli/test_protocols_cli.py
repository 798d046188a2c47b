"""`robochoc protocols`: what there is to solve with, also when a package that offers a protocol is broken."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from textwrap import dedent

import pytest
from click.testing import CliRunner, Result

from robochoc import __version__
from robochoc.cli.group import cli
from robochoc.cli.reports.protocols import print_protocols, rows
from robochoc.protocols.satisfaction import abt
from robochoc.run.purposes import PURPOSES
from robochoc.run.registry import (
    UnknownProtocolError,
    installed_protocol,
    installed_protocols,
    protocol_named,
    protocol_names,
)
from tests.support.cases import cases
from tests.support.program import robochoc_within

WITHOUT_DOCSTRING = """
    from robochoc.protocols.local_search.dsa import DSA
    from robochoc.protocols.satisfaction.first_fit import FirstFit
    from robochoc.protocols.satisfaction.first_fit_messages import Placed
    from robochoc.protocols.dynamic import DynamicProtocol
    from robochoc.protocols.protocol import Protocol
    from robochoc.protocols.traits import Traits

    class Other(FirstFit, DynamicProtocol):
        messages = Placed
        traits = Traits(
            paper="[bold]Nobody[/bold] 1999\\n", complete=False, synchronous=True, costs=True, n_ary=False,
            partially_known=True, dynamic=True, privacy="decisions",
        )

        def change(self, problem, order, invalidated): ...

        def resume(self, *, lossless): ...

    class Variant(DSA):
        pass

    class Static(FirstFit):
        traits = Traits(dynamic=True)

    class Odd(FirstFit):
        traits = "none"

    class Mute(Protocol):
        def start(self): pass
        def receive(self, sender, message): pass

    class Half(Protocol):
        messages = Placed
        def start(self): pass

    NUMBER = 3
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package beside ours, which offers what it should not."""
    (tmp_path / "others.py").write_text(dedent(WITHOUT_DOCSTRING))
    (tmp_path / "leaving.py").write_text("raise SystemExit(3)\n")
    (tmp_path / "garbled.py").write_text("def (:\n")
    about = tmp_path / "others_protocols-1.2.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: others-protocols\nVersion: 1.2\n")
    places = {
        "zz-other": "others:Other",
        "zz-variant": "others:Variant",
        "zz-odd": "others:Odd",
        "zz-static": "others:Static",
        "zz-number": "others:NUMBER",
        "zz-mute": "others:Mute",
        "zz-half": "others:Half",
        "zz-gone": "no_such_module:Gone",
        "zz-without": "others:Without",
        "zz-leaving": "leaving:Leaving",
        "zz-garbled": "garbled:Garbled",
    }
    lines = [f"{name} = {place}" for name, place in places.items()]
    (about / "entry_points.txt").write_text("\n".join(["[robochoc.protocols]", *lines]))
    monkeypatch.syspath_prepend(str(tmp_path))
    return about


def run(*words: str) -> Result:
    return CliRunner().invoke(cli, ["protocols", *words])


def objects(result: Result) -> dict[str, dict[str, object]]:
    return {one["name"]: one for one in map(json.loads, result.stdout.splitlines())}


def row(table: str, name: str) -> str:
    (found,) = (line for line in table.splitlines() if line.split()[:1] == [name])
    return found


def test_the_list_has_a_line_for_each_protocol_and_the_central_solver() -> None:
    done = robochoc_within("protocols")
    assert done.returncode == 0
    assert done.stderr == ""
    heading, *lines = done.stdout.splitlines()
    assert heading.split() == ["name", "for", "complete", "use", "when"]
    assert [line.split()[0] for line in lines] == [*protocol_names(), "central"]
    assert row(done.stdout, "abt").split()[1:3] == ["satisfaction", "yes"]
    assert row(done.stdout, "abt").endswith(abt.ABT.traits.use_when)
    assert "\x1b" not in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 100
    for name in protocol_names():
        assert 0 < len(protocol_named(name).traits.use_when) <= 60


def test_the_long_list_has_all_traits() -> None:
    told = robochoc_within("protocols", "--long").stdout
    heading = "name for complete synchronous constraints dynamic arrays lossy privacy paper"
    assert told.splitlines()[0].split() == heading.split()
    assert row(told, "abt").split()[1:7] == ["satisfaction", "yes", "no", "n-ary,", "PKC", "no"]
    assert abt.ABT.traits.paper in row(told, "abt")
    assert abt.ABT.traits.privacy in row(told, "abt")
    assert "not a protocol" in row(told, "central")
    assert "n-ary, PKC" in row(told, "central")


@pytest.mark.usefixtures("package")
def test_the_list_can_be_of_one_purpose() -> None:
    listed = {name: {line.split()[0] for line in run("--for", name).stdout.splitlines()[1:]} for name in PURPOSES}
    assert {"abt", "dba", "disfc"} <= listed["satisfaction"]
    assert {"dpop", "mgm", "syncabb", "central"} <= listed["costs"]
    assert {"dpop", "sfb", "central"} <= listed["optimum"] < listed["costs"]
    assert {"acls", "syncabb"} <= listed["asymmetric"] < listed["costs"]
    assert "mgm" not in listed["asymmetric"]
    assert {"abt", "cocoa", "dsa", "maxsum"} <= listed["large-teams"]
    assert listed["large-teams"].isdisjoint({"dpop", "duct", "ssi"})
    assert listed["privacy"] == {
        *("disfc", "p-dpop", "p2-dpop", "p32-dpop", "p-dsa", "p-maxsum", "p-mgm", "pc-syncbb"),
    }
    assert {"dynabt", "s-dpop"} <= listed["change"]
    assert "abt" not in listed["change"]
    assert listed["counting"] == {"count-dpop", "list-dpop", "central"}
    assert listed["objectives"] == {"mo-dpop"}
    assert listed["tasks"] == {"cbaa", "cbba", "grape", "ssi"}
    assert listed["comparison"] == {"adopt", "afc", "awc", "sbt", "syncbb"}
    working = {name: one for name, one in objects(run("--json")).items() if "broken" not in one}
    assert sorted([*listed["satisfaction"], *listed["costs"]]) == sorted(working)
    for name, one in working.items():
        assert one["purposes"] == [purpose for purpose, names in listed.items() if name in names], name
    assert set(objects(run("--for", "asymmetric", "--json"))) == listed["asymmetric"]


@pytest.mark.usefixtures("package")
def test_all_purposes_are_listed_with_their_protocols() -> None:
    blocks = re.findall(r"^([\w-]+): (.+)\n((?:  .+\n)+)", run("--for", "all").stdout, re.MULTILINE)
    assert {name: text for name, text, _ in blocks} == {name: each.description for name, each in PURPOSES.items()}
    for name, _, members in blocks:
        assert {*re.split(r",\s+", members.strip())} == {*objects(run("--for", name, "--json"))}
    assert {*objects(run("--for", "all", "--json"))} == {*objects(run("--json"))}


def test_the_help_names_every_purpose() -> None:
    text = " ".join(run("--help").stdout.split())
    assert f"Purposes: {', '.join(PURPOSES)}." in text


def test_one_protocol_is_not_asked_for_by_kind() -> None:
    done = run("abt", "--for", "costs")
    assert done.exit_code == 2
    assert "--for selects rows of the list" in done.stderr


@pytest.mark.usefixtures("package")
def test_other_packages_protocols_are_listed_beside_ours() -> None:
    told = row(run("--long").stdout, "zz-other")
    assert told.split()[1:7] == ["optimisation", "no", "yes", "binary,", "PKC", "yes"]
    assert r"[bold]Nobody[/bold] 1999\n" in told
    assert "decisions" in told


@pytest.mark.usefixtures("package")
def test_a_variant_does_not_inherit_the_form_as_arrays() -> None:
    assert "also as arrays" in run("dsa").stdout
    assert "also as arrays" not in run("zz-variant").stdout
    assert objects(run("--json"))["zz-variant"]["arrays"] is False


@pytest.mark.usefixtures("package")
def test_what_is_broken_is_shown_with_its_reason() -> None:
    table, told = run(), objects(run("--json"))
    assert table.exit_code == 0
    with cases() as each:
        for name, reason in [
            ("zz-gone", "no_such_module:Gone (package others-protocols 1.2) cannot be imported: ModuleNotFoundError"),
            ("zz-without", "others:Without (package others-protocols 1.2) cannot be imported: AttributeError"),
            ("zz-mute", "does not declare its messages"),
            ("zz-half", "does not define receive"),
            ("zz-leaving", "cannot be imported: SystemExit: 3"),
            ("zz-garbled", "cannot be imported: SyntaxError"),
            ("zz-number", "is not a subclass of Protocol"),
            ("zz-odd", "traits that are not of the class Traits"),
            ("zz-static", "must be dynamic if, and only if, it is a DynamicProtocol"),
        ]:
            with each(name):
                assert f"{name} " in table.stdout
                assert "broken" in next(line for line in table.stdout.splitlines() if line.split()[:1] == [name])
                assert reason in next(line for line in table.stdout.splitlines() if line.startswith(f"{name}: "))
                assert reason.rpartition(")")[2].strip() in str(told[name]["broken"])
                asked = run(name)
                assert asked.exit_code == 2
                assert reason in asked.stderr
                assert len(asked.stderr.splitlines()) == 1
                with pytest.raises(UnknownProtocolError, match=f"installed as protocol '{name}', "):
                    protocol_named(name)


def test_of_two_with_one_name_none_is_taken(package: Path) -> None:
    (package / "entry_points.txt").write_text("[robochoc.protocols]\nabt = others:Other\n")
    first, second = (offer for offer in installed_protocols() if offer.name == "abt")
    assert {first.package, second.package} == {"others-protocols 1.2", f"robochoc {__version__}"}
    assert first.protocol is second.protocol is installed_protocol("abt").protocol is None
    assert "is offered by several packages: " in run().stdout
    with pytest.raises(UnknownProtocolError, match=r"others:Other \(others-protocols\)"):
        protocol_named("abt")


def test_json_is_an_object_a_line() -> None:
    found = objects(run("--json"))
    traits = vars(abt.ABT.traits)
    renamed = {"everywhere": traits["shared_scopes"], "beyond": traits["writes_to_non_neighbours"]}
    assert found["abt"] == {
        "name": "abt",
        "place": "robochoc.protocols.satisfaction.abt:ABT",
        "package": f"robochoc {__version__}",
        "distributed": True,
        **{key: value for key, value in traits.items() if key not in {"shared_scopes", "writes_to_non_neighbours"}},
        **renamed,
        "concludes": ["no-solution"],
        "purposes": ["satisfaction", "large-teams"],
        "settings": {},
    }
    assert found["central"]["distributed"] is False
    assert "doc" not in found["abt"]
    (one,) = objects(run("abt", "--json")).values()
    assert str(one["doc"]).startswith("Asynchronous Backtracking (ABT).\n\nComplete")


def test_a_protocol_is_explained_by_its_docstring() -> None:
    done = run("abt")
    head, _, doc = done.stdout.partition("\n\n")
    what, place = head.splitlines()
    assert what.startswith("abt: satisfaction; complete; robots act at the same time; ")
    assert place == f"robochoc.protocols.satisfaction.abt:ABT, from the package robochoc {__version__}"
    assert abt.__doc__ is not None
    assert doc.splitlines() == abt.__doc__.partition(">>>")[0].strip().splitlines()
    assert "central solver" in " ".join(run("central").stdout.split())


@pytest.mark.usefixtures("package")
def test_a_protocol_without_docstring_says_so() -> None:
    assert "others:Other, from the package others-protocols 1.2" in run("zz-other").stdout
    assert "no docstring" in run("zz-other").stdout


def test_an_unknown_protocol_is_wrong_usage() -> None:
    for name, near in [("abtt", "abt"), ("centrl", "central"), ("ABT ", None)]:
        done = robochoc_within("protocols", name)
        assert done.returncode == 2
        assert done.stdout == ""
        assert len(done.stderr.splitlines()) == 1
        if near:
            assert f"; did you mean '{near}'" in done.stderr


def test_solve_points_to_the_list() -> None:
    assert "robochoc protocols" in " ".join(robochoc_within("solve", "--help").stdout.split())


def test_the_list_is_wrapped_to_the_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for columns in [60, 80, 200]:
        monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
        monkeypatch.setenv("COLUMNS", str(columns))
        print_protocols(rows())
        *table, last = re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out).splitlines()
        assert all(len(line) <= columns for line in table)
        assert (len(table) == 1 + len(rows())) is (columns == 200)
        assert last.startswith("next: robochoc protocols NAME")


def test_how_a_protocol_is_chosen_is_explained() -> None:
    head, *lines = robochoc_within("protocols", "auto").stdout.splitlines()
    assert head.startswith("auto: ")
    rules = [line for line in lines if re.match(r"  \S", line)]
    assert {rule.split(":")[0].strip() for rule in rules} <= {*protocol_names()}
    assert rules[-1] == "  sfb: all other teams"
    assert "  dsa: costs; more than 300 robots; nothing is forbidden" in rules
