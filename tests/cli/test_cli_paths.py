"""Paths on the command line: all of them are looked at before anything is done, whatever they lead to."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import pytest

from robochoc.system.files import AppendableFile, PendingFile, resolved, write_atomically
from tests.support.cases import cases
from tests.support.program import robochoc_within

RESULT = {
    "team": "queens3d-4",
    "protocol": "abt",
    "runtime": "simulator",
    "seed": 0,
    "verdict": "no-solution",
    "assignment": {},
    "cost": 0,
    "withdrawn": [],
    "epochs": [],
    "metrics": {"messages": 0, "bytes": 0, "ncccs": 0, "checks": 0, "wall_s": 0},
    "verified": True,
}


def line(*words: object) -> tuple[int, str]:
    """The exit status, and all that is said but how commands are used; nothing is told as a result."""
    done = robochoc_within(*words)
    assert done.stdout == ""
    said = [word for word in done.stderr.splitlines() if word and not word.startswith(("Usage:", "Try 'robochoc "))]
    return done.returncode, "\n".join(said)


@pytest.fixture
def circle(tmp_path: Path) -> Path:
    """A symbolic link that leads to itself by another one."""
    (tmp_path / "there").symlink_to("here")
    (tmp_path / "here").symlink_to("there")
    return tmp_path / "here"


@pytest.mark.parametrize(
    "content",
    [
        json.dumps({**RESULT, "team": "x"}).encode().replace(b'"x"', b'"\xff\xfe"'),
        json.dumps(RESULT).encode("utf-16"),
        json.dumps(RESULT).encode()[:-1] + b', "other": ' + b"[" * 100_000 + b"]" * 100_000 + b"}",
    ],
)
@pytest.mark.parametrize("command", [["fly"], ["animate", "-o", "page.html"]])
def test_a_result_that_no_robochoc_wrote_is_one_line(
    content: bytes, command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("result.json").write_bytes(content)
    done = robochoc_within(command[0], "result.json", *command[1:])
    assert (done.returncode, done.stdout) == (1, "")
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith("result.json: ")
    assert not Path("page.html").exists()


def test_text_that_is_not_utf_8_is_said_to_be_so(four: Path, tmp_path: Path) -> None:
    for words, content in [
        (("journal", "show", "{file}"), b'{"event":"Journal","team":"\xff","protocol":"abt","runtime":"s","seed":0}\n'),
        (("solve", "{team}", "--runtime", "simulator", "--channel", "{file}"), b"latency_ms = 1 # \xff"),
        (("solve", "{team}", "--order", "{file}"), b"Robot1.1\xff"),
    ]:
        file = tmp_path / "file"
        file.write_bytes(content)
        status, said = line(*(word.format(file=file, team=four) for word in words))
        assert status == 1
        assert said.startswith(f"{file}: ")
        assert "not UTF-8" in said


def test_links_in_a_circle_are_one_line(circle: Path, four: Path) -> None:
    with cases() as each:
        for words in [
            ("export", "{team}", "-o", "{file}"),
            ("export", "{team}", "-o", "{file}/below"),
            ("solve", "{team}", "--html", "{file}"),
            ("solve", "{team}", "--journal", "{file}"),
            ("solve", "{team}", "--ros", "mcap:{file}"),
            ("solve", "{team}", "--ros", "rosbag:{file}"),
            ("solve", "{team}", "--situation", "mcap:{file}"),
            ("solve", "{team}", "--order", "{file}"),
            ("solve", "{file}"),
            ("compile", "{file}"),
            ("export", "{file}"),
            ("fly", "{file}"),
            ("privacy", "{file}"),
            ("replay", "{file}"),
            ("sniff", "{file}"),
            ("journal", "show", "{file}"),
            ("generate", "queens3d", "--n", "4", "-o", "{file}"),
            ("generate", "queens3d", "--n", "4", "-o", "{file}/below"),
        ]:
            with each(words):
                status, said = line(*(word.format(file=circle, team=four) for word in words))
                assert status in {1, 2}
                assert len(said.splitlines()) == 1
                assert str(circle) in said
                assert "exists already" in said or "Too many levels of symbolic links" in said
                assert circle.is_symlink()


def test_what_writes_files_says_it_as_an_os_error(circle: Path) -> None:
    for write in (
        resolved,
        PendingFile,
        partial(write_atomically, content=b""),
        partial(AppendableFile, beginning=b""),
    ):
        with pytest.raises(OSError, match="Too many levels"):
            write(circle)
        assert circle.is_symlink()


def test_nothing_is_done_by_half_where_a_path_is_wrong(four: Path, tmp_path: Path) -> None:
    for command in [["solve", "--runtime", "simulator"], ["compile"]]:
        status, said = line(*command, four, tmp_path / "missing", tmp_path / "empty")
        assert status == 1
        assert [part.split(":")[0] for part in said.splitlines()] == [f"{tmp_path}/missing", f"{tmp_path}/empty"]


def test_nothing_that_is_read_is_written_over(four: Path, tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(json.dumps(RESULT).encode())
    (tmp_path / "link").symlink_to("file")
    before = {path: path.read_bytes() for path in (file, *four.iterdir())}
    with cases() as each:
        for words, said in [
            (("export", "{team}", "-o", "{team}/Robot1.1.xml"), "would be a file of the team"),
            (("solve", "{team}", "--html", "{team}/page.xml"), "would be a file of the team"),
            (("solve", "{team}", "--order", "{file}", "--journal", "{file}"), "are the same place"),
            (("animate", "{file}", "-o", "{file}"), "are the same place"),
            (("fly", "{file}", "--html", "{link}"), "are the same place"),
            (("journal", "export", "{file}", "--format", "csv", "-o", "{file}"), "are the same place"),
        ]:
            with each(words):
                status, told = line(*(word.format(file=file, team=four, link=tmp_path / "link") for word in words))
                assert status == 2
                assert said in " ".join(told.split())
                assert {path: path.read_bytes() for path in (file, *four.iterdir())} == before
