"""`robochoc completion`: what shells are given, and bash itself."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner

from robochoc.cli.commands.completion import SHELLS, VARIABLE
from robochoc.cli.group import COMMANDS, cli
from robochoc.run.registry import protocol_names
from tests.support.cases import cases

WANTED = """
source <("{robochoc}" completion bash)
"""
COMPLETED = """
COMPREPLY=(); COMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1))
_robochoc_completion "{robochoc}"
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


def completions(*words: str) -> list[str]:
    *before, last = words
    return [one.value for one in ShellComplete(cli, {}, "robochoc", VARIABLE).get_completions(before, last)]


def test_each_shell_is_given_a_script() -> None:
    for shell in SHELLS:
        done = CliRunner().invoke(cli, ["completion", shell])
        assert done.exit_code == 0
        assert VARIABLE in done.stdout


def test_names_are_completed() -> None:
    with cases() as each:
        for words, found in [
            (("so",), ["solve"]),
            (("solve", "--proto"), ["--protocol"]),
            (("solve", "--protocol", "AFC"), ["afc", "afc-ng", "afc-tree"]),
            (("master", "--protocol", "dpo"), ["dpop"]),
            (("protocols", "dpo"), ["dpop"]),
            (("solve", "--order", "d"), ["dom-deg", "dfs"]),
            (("solve", "--channel", "wp"), ["wpan"]),
            (("solve", "--runtime", "si"), ["simulator"]),
            (("solve", "--withdraw", "--runtime", "ne"), ["network"]),
            (("solve", "--withdraw", "max"), ["maximal"]),
            (("completion", ""), [*SHELLS]),
        ]:
            with each(words):
                assert completions(*words) == found


def test_all_commands_and_protocols_are_completed() -> None:
    assert completions("") == [*COMMANDS]
    assert completions("solve", "--protocol", "") == ["auto", *protocol_names(), "central"]


def test_folders_of_teams_are_completed_by_the_shell() -> None:
    found = ShellComplete(cli, {}, "robochoc", VARIABLE).get_completions(["compile"], "inst")
    assert [(one.type, one.value) for one in found] == [("dir", "inst")]


def test_files_of_other_tools_are_completed_by_the_shell() -> None:
    found = ShellComplete(cli, {}, "robochoc", VARIABLE).get_completions(["solve"], "prob")
    assert [(one.type, one.value) for one in found] == [("file", "prob")]
    formats = ShellComplete(cli, {}, "robochoc", VARIABLE).get_completions(["export", "--format"], "p")
    assert [one.value for one in formats] == ["pydcop"]


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
def test_bash_completes(tmp_path: Path) -> None:
    program = Path(sys.executable).with_name("robochoc")
    script = WANTED.format(robochoc=program)
    for words in ("robochoc solve --protocol agi", "robochoc prot", "robochoc compile --no"):
        script += COMPLETED.format(robochoc=program, words=words)
    asked = ["bash", "--norc", "--noprofile", "-c", script]
    done = subprocess.run(asked, capture_output=True, text=True, check=True, cwd=tmp_path, env=dict(os.environ))
    assert done.stdout.split() == ["agile-abt", "protocols", "--no-cache"]
