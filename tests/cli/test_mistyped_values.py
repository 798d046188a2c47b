"""Mistyped values of options: one message in plain English, which says what may have been meant."""

from __future__ import annotations

from click.testing import CliRunner

from robochoc.cli.group import cli
from tests.support.program import ROOT

HANGAR = str(ROOT / "docs" / "examples" / "hangar")


def test_a_mistyped_value_is_told() -> None:
    for words, told in [
        (("--situation", "flight", "--wind", "strong"), "'strong' is no speed such as 3, nor three numbers"),
        (("--situation", "flite"), "rospy; did you mean 'flight'?"),
        (("--seed", "x"), "'x' is no whole number of at least 0"),
        (("--message-loss", "3"), "'3' is no number from 0 to 0.9"),
        (("--deadline", "0"), "'0' is no number greater than 0"),
    ]:
        done = CliRunner().invoke(cli, ["solve", HANGAR, *words])
        assert done.exit_code == 2
        assert told in " ".join(done.stderr.split())
