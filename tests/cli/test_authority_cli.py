"""`robochoc authority`: what it prints, what it says when it cannot, and that it never hurts what is there."""

from __future__ import annotations

import json
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from robochoc.authority.authority import Authority
from robochoc.authority.certificates import fingerprint, new_key, signing_request
from robochoc.authority.token import EnrolmentToken
from robochoc.cli.group import cli
from tests.support.cases import cases
from tests.support.program import ROOT


def say(folder: Path, *words: object) -> Result:
    """Run `robochoc authority`, for the Authority in `folder`."""
    result = CliRunner().invoke(cli, ["authority", *map(str, words), "--authority", str(folder)])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    place = tmp_path / "home" / "authority"
    assert say(place, "init").exit_code == 0
    return place


def states(folder: Path) -> dict[str, str]:
    rows = [json.loads(line) for line in say(folder, "list", "--json").stdout.splitlines()]
    return {row["name"]: row["state"] for row in rows}


def test_init_makes_one_authority_and_no_second(folder: Path) -> None:
    key = (folder / "ca.key").read_bytes()
    assert stat.S_IMODE((folder / "ca.key").stat().st_mode) == 0o600
    again = say(folder, "init")
    assert (again.exit_code, again.stdout) == (1, "")
    assert "already" in again.stderr
    assert (folder / "ca.key").read_bytes() == key


def test_where_it_is_if_nothing_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    result = CliRunner().invoke(cli, ["authority", "init"])
    assert result.exit_code == 0
    assert "next: robochoc authority enrol NAME" in result.stdout
    (key,) = tmp_path.rglob("ca.key")
    assert CliRunner().invoke(cli, ["authority", "list"]).stdout.startswith("no names are enrolled")
    assert key.parent.name == "authority"


def test_tokens_that_are_printed_work(folder: Path) -> None:
    result = say(folder, "enrol", "Robot1.1", "Robot1.2", "--token-ttl", "0.5")
    authority = Authority.open(folder)
    lines = dict(line.split(" ") for line in result.stdout.splitlines())
    assert list(lines) == ["Robot1.1", "Robot1.2"]
    for name, text in lines.items():
        token = EnrolmentToken.parse(text)
        assert token.fingerprint == fingerprint(authority.certificate)
        authority.redeem(token.secret, signing_request(new_key(), name))
    assert states(folder) == {"Robot1.1": "in force", "Robot1.2": "in force"}


def test_a_whole_team_by_its_files_names(folder: Path, tmp_path: Path) -> None:
    team = tmp_path / "team"
    team.mkdir()
    for name in ("Robot10.xml", "Robot2.xml", "scenario.xml", ".hidden.xml", "notes.txt"):
        (team / name).write_text("not even XML")
    result = say(folder, "enrol", "--team", team, "--role", "robot", "--json")
    rows = [json.loads(line) for line in result.stdout.splitlines()]
    assert [(row["name"], row["role"], row["hours"]) for row in rows] == [
        ("Robot2", "robot", 24),
        ("Robot10", "robot", 24),
    ]
    EnrolmentToken.parse(rows[0]["token"])
    assert set(states(folder)) == {"Robot2", "Robot10"}


def test_observers(folder: Path) -> None:
    assert say(folder, "enrol", "Sniffer", "--role", "observer").exit_code == 0
    (row,) = (json.loads(line) for line in say(folder, "list", "--json").stdout.splitlines())
    assert (row["role"], row["state"]) == ("observer", "invited")
    assert row["expires"].endswith("Z")


def test_the_table(folder: Path) -> None:
    say(folder, "enrol", "Robot1.1", "A" * 64)
    say(folder, "revoke", "Robot1.1")
    heading, *rows = say(folder, "list").stdout.splitlines()
    assert heading.split() == ["name", "role", "may", "state", "expires", "(UTC)"]
    assert rows[0].split()[:4] == ["A" * 64, "robot", "-", "invited"]
    assert rows[1].split() == ["Robot1.1", "robot", "-", "revoked", "-"]


def test_who_may_sniff(folder: Path) -> None:
    def rights() -> dict[str, list[str]]:
        rows = (json.loads(line) for line in say(folder, "list", "--json").stdout.splitlines())
        return {row["name"]: row["may"] for row in rows}

    say(folder, "enrol", "Robot1.1")
    say(folder, "enrol", "Eye", "--role", "observer", "--may", "sniff")
    assert rights() == {"Eye": ["sniff"], "Robot1.1": []}
    assert say(folder, "list").stdout.splitlines()[1].split()[:4] == ["Eye", "observer", "sniff", "invited"]
    say(folder, "revoke", "Eye")
    assert rights()["Eye"] == []
    say(folder, "enrol", "Robot1.1", "Eye", "--may", "sniff")
    assert rights() == {"Eye": ["sniff"], "Robot1.1": ["sniff"]}
    say(folder, "enrol", "Robot1.1")
    assert rights()["Robot1.1"] == []


def test_revoked_and_readmitted(folder: Path) -> None:
    say(folder, "enrol", "A")
    result = say(folder, "revoke", "A")
    assert "to accept it again: robochoc authority enrol A" in result.stdout
    assert states(folder) == {"A": "revoked"}
    say(folder, "enrol", "A")
    assert states(folder) == {"A": "invited"}


def test_what_cannot_be_done_is_said(folder: Path) -> None:
    with cases() as each:
        for words, status, told in [
            (["enrol"], 2, "--team"),
            (["enrol", "A/B"], 2, "'A/B' is not a valid name of a robot"),
            (["enrol", "A\x1b[2J"], 2, r"\x1b"),
            (["enrol", "Good", "MASTER"], 2, "MASTER"),
            (["enrol", "A", "--role", "master"], 2, "add --host NAME"),
            (["enrol", "A", "--role", "king"], 2, "--role"),
            (["enrol", "A", "--may", "fly"], 2, "--may"),
            (["enrol", "A", "--token-ttl", "0"], 2, "--token-ttl"),
            (["enrol", "A", "--token-ttl", "nan"], 2, "--token-ttl"),
            (["enrol", "--team", "/no/such/folder"], 1, "does not exist"),
            (["revoke", "Robot1.2"], 2, "did you mean 'Robot1.1'?"),
            (["revoke", "MASTER"], 2, "cannot be revoked"),
        ]:
            with each(words):
                say(folder, "enrol", "Robot1.1")
                result = say(folder, *words)
                assert (result.exit_code, result.stdout) == (status, "")
                assert told in result.stderr
                assert "\x1b" not in result.stderr
                assert set(states(folder)) == {"Robot1.1"}


def test_without_an_authority_the_next_step_is_said(tmp_path: Path) -> None:
    for words in [["enrol", "A"], ["list"], ["revoke", "A"]]:
        result = say(tmp_path / "nowhere", *words)
        assert result.exit_code == 1
        assert result.stderr.endswith("run: robochoc authority init\n")
        assert not (tmp_path / "nowhere").exists()


def test_a_damaged_authority(folder: Path) -> None:
    (folder / "registry.json").write_text("{")
    result = say(folder, "list")
    assert result.exit_code == 1
    assert "not a registry" in result.stderr


def test_without_the_extra_it_says_what_to_install(tmp_path: Path) -> None:
    program = "import sys; sys.modules['cryptography'] = None; from robochoc.cli.main import main; main()"
    words = [sys.executable, "-c", program, "authority", "init", "--authority", str(tmp_path / "authority")]
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 2
    assert done.stderr == "the Authority requires 'cryptography'; run: pip install 'robochoc[network]'\n"


def test_the_docs_know_it() -> None:
    security, machines = (ROOT / "docs" / "guides" / f"{page}.md" for page in ("security", "several-machines"))
    for command in ("init", "enrol", "list", "revoke"):
        assert f"robochoc authority {command}" in security.read_text()
        assert f"robochoc authority {command}" in machines.read_text()
