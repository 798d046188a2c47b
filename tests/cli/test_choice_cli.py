"""`robochoc solve` where protocol or order are chosen: what is said of it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import robochoc
from robochoc.cli.reports.choice import LONG_S, OrderNote
from robochoc.communication.search_result import Progress
from robochoc.generators.queens3d import queens3d
from robochoc.model.orders import Order
from robochoc.run import Options, Withdrawal
from tests.support.program import ROOT, robochoc_within

PATROL = ROOT / "docs" / "examples" / "patrol"


def test_what_was_chosen_is_said_with_the_reason_and_more_on_request(four: Path) -> None:
    said = robochoc_within("solve", four, "--runtime", "simulator", "--explain").stdout
    assert "  chosen: sfb, as " in said
    assert "; order min-width, as " in said
    assert (
        "  the team: 16 robots, 76 pairs of neighbours (9.5 each in the mean); no costs: any solution will do; " in said
    )
    assert "  not dpop: there are no costs\n" in said
    assert "; a constrainedness of about " in said
    assert "  not abt: no constraint is partially known (PKC); the constrainedness is 0.48 or more" in said
    assert "  not sfb" not in said
    assert "message is lost" not in said


def test_who_refuses_the_options_is_told_with_the_reason(four: Path) -> None:
    said = robochoc_within("solve", four, "--runtime", "arrays", "--explain").stdout
    assert "  chosen: dsa, as it accepts the team with these options" in said
    assert "  not sfb: the problem does not change; there are no costs; sfb has no array implementation; add" in said
    assert "  not dsa" not in said


def test_where_messages_are_lost_the_choice_says_so(four: Path) -> None:
    said = robochoc_within("solve", four, "--runtime", "simulator", "--message-loss", "0.2", "--explain").stdout
    assert "  chosen: dsa, as many messages may be lost: " in said
    assert "; messages are lost with a probability of 0.2 at most; " in said
    assert "  not gdba: more than 10% of the messages are lost\n" in said


def test_nothing_is_said_of_a_choice_where_all_was_asked_for(four: Path) -> None:
    words = ["solve", four, "--runtime", "simulator", "--protocol", "abt"]
    assert "chosen" not in robochoc_within(*words, "--explain").stdout
    result = json.loads(robochoc_within(*words, "--json").stdout)
    assert not {"chosen", "order"} & result.keys()


def test_a_file_of_another_tool_gives_no_order(tmp_path: Path) -> None:
    robochoc_within("export", PATROL, "--format", "pydcop", "-o", tmp_path / "patrol.yaml")
    words = ["solve", tmp_path / "patrol.yaml", "--runtime", "simulator", "--protocol", "syncbb", "--json"]
    result = json.loads(robochoc_within(*words).stdout)
    assert (result["order"], result["chosen"]) == (
        "max-degree",
        {"order": "the imported file orders no robots"},
    )
    assert not {"chosen", "order"} & json.loads(robochoc_within(*words, "--order", "given").stdout).keys()


def test_a_model_gives_an_order_if_a_robot_has_a_priority() -> None:
    for priority, order in ((0, Order.MAX_DEGREE), (1, None)):
        model = robochoc.Model("three")
        x, y, z = (model.robot(name, priority=priority).variable("v", range(3)) for name in "abc")
        model.add(x < y, y < z)
        assert model.solve("abt", runtime="simulator").order == order
    team = queens3d(4)
    assert robochoc.Model.of(team).solve("abt", runtime="simulator").order is None
    assert robochoc.Problem(team).solve("abt", runtime="simulator").order is None


def test_it_is_said_once_that_another_order_is_usually_faster(capsys: pytest.CaptureFixture[str]) -> None:
    note = OrderNote(queens3d(4), Options(protocol="abt"))
    show = note.observing(lambda _: None)
    assert show is not None
    show(Progress(0, 2 * LONG_S, "compiling"))
    show(Progress(9, LONG_S / 2, ""))
    assert capsys.readouterr().err == ""
    show(Progress(9, LONG_S, ""))
    show(Progress(9, LONG_S, ""))
    note.print_if_slow(LONG_S)
    said = capsys.readouterr().err
    assert said == (
        "queens3d-4: --order max-degree is usually faster than the order of the files; --protocol auto chooses one\n"
    )


@pytest.mark.parametrize(
    "options",
    [
        Options(protocol="abt", order=Order.DFS),
        Options(protocol="sfb", chosen={"protocol": "it suits"}, order=Order.MIN_WIDTH),
        Options(protocol="dpop"),
        Options(protocol="abt", withdraw=Withdrawal.MAXIMAL),
    ],
)
def test_it_is_not_said_where_it_is_not_so(options: Options, capsys: pytest.CaptureFixture[str]) -> None:
    OrderNote(queens3d(4), options).print_if_slow(LONG_S)
    assert capsys.readouterr().err == ""
