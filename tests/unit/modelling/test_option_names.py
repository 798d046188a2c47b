"""Messages to users of the library name arguments, not options of the command line."""

from __future__ import annotations

import inspect
import re

import pytest

import robochoc
from robochoc.modelling.option_names import in_python
from robochoc.modelling.solving import ARGUMENTS
from robochoc.run.compatibility import option_rules, team_rules
from tests.support.cases import looped

OF_OTHER_COMMANDS = {"--private", "--situation", "--long"}
"""Options in these messages that `solve` in Python does not have."""


@looped(
    ("text", "expected"),
    [
        ("add --runtime simulator --schedule cycles", "add runtime='simulator', schedule='cycles'"),
        ("--deadline and --timeout", "deadline and timeout"),
        ("(--ncccs 100, --deadline 0.5)", "(ncccs=100, deadline=0.5)"),
        ("after --deadline SECONDS: add it", "after deadline=SECONDS: add it"),
        ("these do: sfb (--protocol)", "these do: sfb (protocol)"),
        ("--set cycles=N and --set anytime=yes", "settings={'cycles': N} and settings={'anytime': 'yes'}"),
        ("--message-loss or --on-loss fail", "message_loss or on_loss='fail'"),
        ("--spare and --with ortools.", "spares and central_with='ortools'."),
        ("use --host NAME", "use --host NAME"),
        ("well-known -- x--timeout", "well-known -- x--timeout"),
    ],
)
def test_options_become_arguments(text: str, expected: str) -> None:
    assert in_python(text, ARGUMENTS) == expected


def test_no_rule_names_an_option_that_python_lacks() -> None:
    for module in (option_rules, team_rules):
        options = set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", inspect.getsource(module)))
        left = {one for one in options if one in in_python(one, ARGUMENTS)}
        assert len(options) > 5
        assert left <= OF_OTHER_COMMANDS


def test_errors_and_reasons_name_arguments() -> None:
    model = robochoc.Model()
    slots = [model.robot(f"r{i}").variable("x", range(4)) for i in range(4)]
    model.add(robochoc.all_different(slots))
    with pytest.raises(robochoc.UnsupportedError, match="runtime='simulator', schedule='cycles'"):
        model.solve(cycles=3)
    outcome = model.solve("abt", messages=1)
    assert (outcome.verdict, outcome.reason) == ("unknown", "the limit of messages was reached (messages=1)")
