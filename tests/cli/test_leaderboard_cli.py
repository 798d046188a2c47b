"""`robochoc leaderboard`, as people use it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from robochoc.experiments.digests import digest_of_team
from robochoc.formats import read_team
from robochoc.leaderboard.instances import instance_named
from robochoc.leaderboard.outside import named_protocols
from robochoc.run.registry import UnknownProtocolError, protocol_named
from tests.support.cases import cases
from tests.support.program import ROOT, robochoc_within

EXAMPLE = ROOT / "docs" / "examples" / "breakout"
TWO = ("--family", "random", "--family", "coloring-hard", "--size", "small", "--seeds", "1", "--jobs", "1")


def test_list_and_export(tmp_path: Path) -> None:
    listed = robochoc_within("leaderboard", "list", "--family", "random", "--size", "small")
    assert listed.stdout.startswith("random-small-0              10 robots  optimal 399    toulbar2, dpop\n")
    as_json = robochoc_within("leaderboard", "list", "--family", "random", "--json").stdout.splitlines()
    assert json.loads(as_json[0])["cost"] == 399
    team = instance_named("random-small-0").team()
    done = robochoc_within("leaderboard", "export", "random-small-0", "-o", tmp_path / "team")
    assert done.returncode == 0
    assert digest_of_team(read_team(tmp_path / "team")) == digest_of_team(team)
    with cases() as each:
        for form in ("xcsp3", "frodo", "pydcop"):
            with each(form):
                path = tmp_path / f"file.{form}"
                done = robochoc_within("leaderboard", "export", "random-small-0", "--format", form, "-o", path)
                assert done.returncode == 0
                assert path.stat().st_size > 1000
                again = robochoc_within("leaderboard", "export", "random-small-0", "--format", form, "-o", path)
                assert (again.returncode, "use --force" in again.stderr) == (1, True)


def test_run_verify_submit_and_show(tmp_path: Path) -> None:
    path, board, site = tmp_path / "results.json", tmp_path / "board", tmp_path / "site"
    done = robochoc_within("leaderboard", "run", "dpop", "MGM", "dba", *TWO, "-o", path, "--budget", "messages=300")
    assert (done.returncode, done.stderr) == (0, "")
    checked = robochoc_within("leaderboard", "verify", path, "--rerun", "2", "--jobs", "1")
    assert checked.stdout == f"{path}: 6 runs, 2 answers, no fault; 2 repeated runs gave the same results\n"
    added = robochoc_within("leaderboard", "submit", path, "--board", board, "--rerun", "2", "--jobs", "1")
    assert (added.returncode, added.stderr) == (0, checked.stdout)
    shown = robochoc_within("leaderboard", "show", board).stdout
    assert re.search(r"^random, small: Random binary problems$", shown, re.MULTILINE)
    assert "Not for this family: dba." in shown
    robochoc_within("leaderboard", "show", board, "--html", site, "--markdown", tmp_path / "page.md")
    assert sorted(file.name for file in site.iterdir()) == [
        "coloring-hard-small-0.html", "index.html", "random-small-0.html",
    ]  # fmt: skip
    page = (site / "random-small-0.html").read_text()
    assert "toulbar2 proved it, and dpop proved the same" in page
    assert "Best answer here: dpop." in page
    assert "| dpop\\* |" in (tmp_path / "page.md").read_text()
    altered = json.loads(path.read_text())
    altered["runs"][1]["cost"] -= 1
    path.write_text(json.dumps(altered))
    wrong = robochoc_within("leaderboard", "submit", path, "--board", board, "--rerun", "0")
    assert (wrong.returncode, "mgm on random-small-0: the answer" in wrong.stderr) == (4, True)


def test_a_protocol_of_a_module_enters(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(EXAMPLE)
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    path, word = tmp_path / "results.json", "robochoc_breakout:Breakout"
    done = robochoc_within("leaderboard", "run", word, *TWO, "-o", path, "--budget", "messages=200")
    assert (done.returncode, done.stderr) == (0, "")
    (entrant,) = json.loads(path.read_text())["entrants"]
    assert (entrant["name"], entrant["package"]) == ("breakout", "robochoc_breakout 0")
    with pytest.raises(UnknownProtocolError):
        protocol_named("breakout")
    assert entrant["place"] == word
    unknown = robochoc_within("leaderboard", "verify", path, "--jobs", "1")
    assert (unknown.returncode, unknown.stdout) == (0, f"{path}: 2 runs, 0 answers, no fault\n")
    assert f"2 runs of breakout not repeated: its module is not installed; if you trust it, add --protocol {word}" in (
        unknown.stderr
    )
    known = robochoc_within("leaderboard", "verify", path, "--jobs", "1", "--rerun", "1", "--protocol", word)
    assert (known.returncode, known.stderr) == (0, "")
    assert known.stdout == f"{path}: 2 runs, 0 answers, no fault; 1 repeated run gave the same result\n"
    absent = robochoc_within("leaderboard", "verify", path, "--protocol", "nope:Nope")
    assert (absent.returncode, "No module named 'nope'" in absent.stderr) == (2, True)
    altered = json.loads(path.read_text())
    altered["entrants"][0]["source"] = "0"
    path.write_text(json.dumps(altered))
    other = robochoc_within("leaderboard", "verify", path, "--protocol", word)
    assert (other.returncode, "its files (robochoc_breakout 0) have changed" in other.stderr) == (0, True)


BROKEN = """
from robochoc.protocols import Message, Protocol, Traits

class Broken(Protocol):
    messages = Message
    traits = Traits(paper="none", complete=False, costs=True)

    def start(self):
        undefined

    def receive(self, sender, message):
        pass
"""


def test_failed_runs_are_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken_module.py").write_text(BROKEN)
    done = robochoc_within("leaderboard", "run", "broken_module:Broken", *TWO, "-o", tmp_path / "results.json")
    assert done.stderr == (
        "broken: 2 of 2 runs failed, first random-small-0: NameError: name 'undefined' is not defined\n"
    )


def test_names_without_modules_need_no_package() -> None:
    with named_protocols(["dpop", "robochoc.protocols.local_search.mgm:MGM"]) as names:
        assert names == ["dpop", "mgm"]


def test_wrong_usage() -> None:
    with cases() as each:
        for words, message in [
            (["run", "dqop"], "did you mean 'dpop'"),
            (["run", "central"], "'central' cannot be used here; name a distributed protocol"),
            (
                ["run", "nope:Nope"],
                "nope:Nope cannot be imported: ModuleNotFoundError: No module named 'nope'",
            ),
            (
                ["run", "fake:MGM"],
                "fake:MGM would be called 'mgm', as robochoc.protocols.local_search.mgm:MGM (robochoc ",
            ),
            (
                ["run", "one:Mine", "other:Mine"],
                "other:Mine would be called 'mine', as one:Mine already is: rename the class",
            ),
            (["run", "mine/quick_pick.py"], "is a file: name its protocol as quick_pick:CLASS, in the file's folder"),
            (["run", "evil:"], "'evil:' is not of the form MODULE:CLASS"),
            (["run", "json:JSONDecoder"], "json:JSONDecoder is not a subclass of Protocol"),
            (["run", "dpop", "--budget", "hours=3"], "'hours=3' is not one of messages, ncccs, cycles, time"),
            (["run", "dpop", "--budget", "messages=0"], "--budget: 'messages=0' needs whole numbers of 1 or more"),
            (["run", "dpop", "--budget", "messages=nan"], "--budget: 'messages=nan' needs whole numbers of 1 or more"),
            (["run", "dpop", "--family", "rndom"], "did you mean 'random'"),
            (["export", "random-small-99"], "did you mean 'random-small-9'"),
        ]:
            with each(message):
                done = robochoc_within("leaderboard", *words)
                assert (done.returncode, message in done.stderr) == (2, True)
