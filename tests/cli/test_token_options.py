"""Where a token comes from: the command line, the environment, a file that only its owner reads, standard input."""

from __future__ import annotations

import os
from pathlib import Path

import click
from click.testing import CliRunner, Result

from robochoc.cli.options.network import LONGEST, token_options

TOKEN = "abc.def"  # noqa: S105 - none that works


@click.command()
@token_options()
def shown(token: str | None) -> None:
    click.echo(repr(token))


def said(*args: str, stdin: str | bytes | None = None, given: str | None = None) -> Result:
    return CliRunner().invoke(shown, args, input=stdin, env={"ROBOCHOC_TOKEN": given})


def file_of(folder: Path, content: bytes, mode: int = 0o600) -> str:
    path = folder / "token"
    path.write_bytes(content)
    path.chmod(mode)
    return str(path)


def test_without_one() -> None:
    assert said().output == "None\n"


def test_the_command_line_and_the_environment() -> None:
    assert said("--token", TOKEN, given="x.y").output == f"{TOKEN!r}\n"
    assert said(given=TOKEN).output == f"{TOKEN!r}\n"


def test_a_file(tmp_path: Path) -> None:
    for content in ["abc.def", " abc.def\r\n", "Scout abc.def\n"]:
        assert said("--token-file", file_of(tmp_path, content.encode()), given="x.y").output == f"{TOKEN!r}\n"


def test_standard_input() -> None:
    for option in [("--token", "-"), ("--token-file", "-")]:
        assert said(*option, stdin="Scout abc.def\nanother line\n").output == f"{TOKEN!r}\n"


def test_a_file_that_others_may_read_is_refused_as_ssh_does(tmp_path: Path) -> None:
    for mode in [0o640, 0o604, 0o660, 0o644, 0o777]:
        path = file_of(tmp_path, b"abc.def", mode)
        result = said("--token-file", path)
        assert result.exit_code == 1
        why = f"{path}: others may read it (mode {mode:03o}) and use the token; run: chmod 600 {path}\n"
        assert result.output == why
        assert TOKEN not in result.output


def test_a_file_that_holds_no_token(tmp_path: Path) -> None:
    for content, found in [
        (b"", "no token"),
        (b" \n", "no token"),
        (b"A a.b\nB c.d\n", "more than one token"),
        (b"x" * (LONGEST + 1), "more than one token"),
        (b"\0 \xff \x1b[2J", "more than one token"),
    ]:
        path = file_of(tmp_path, content)
        result = said("--token-file", path)
        expected = f"{path}: {found} (expected one line of 'robochoc authority enrol')\n"
        assert (result.exit_code, result.output) == (1, expected)


def test_a_file_that_is_not_there_or_is_a_folder(tmp_path: Path) -> None:
    assert said("--token-file", str(tmp_path / "none")).exit_code == 1
    result = said("--token-file", str(tmp_path))
    assert (result.exit_code, result.output.count("\n")) == (1, 1)


def test_a_pipe_has_no_mode_to_look_at() -> None:
    reading, writing = os.pipe()
    os.write(writing, TOKEN.encode())
    os.close(writing)
    assert said("--token-file", f"/dev/fd/{reading}").output == f"{TOKEN!r}\n"
    os.close(reading)


def test_two_at_once() -> None:
    result = said("--token", TOKEN, "--token-file", "x")
    assert result.exit_code == 2
    assert "both give the token" in result.output
