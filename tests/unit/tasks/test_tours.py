"""Tours: the way to a task begins where the one before it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from robochoc.run import Options, Runtime, solve
from tests.support.task_lists import imported, mistakes

TOURS = """distance: streets
tours: yes
robots:
  ann: {at: [0, 0]}
  bob: {at: [9, 9], most: 1}
tasks:
  near: {at: [4, 0], worth: 5}
  far: {at: [6, 0], worth: 5}
  late: {at: [6, 1], worth: 5, deadline: 6}
  radio: {worth: 1}
"""


def cost_of(text: str, folder: Path, protocol: str = "dpop") -> Any:  # noqa: ANN401 - an exact number
    return solve(imported(text, folder).team, Options(protocol=protocol, runtime=Runtime.SIMULATOR)).cost


def test_the_way_to_a_task_begins_where_the_one_before_it_is(tmp_path: Path, warm_ace: None) -> None:
    """The robot ann does near, far and radio, 6 away; a way of its own pays not for far. There is no time for late."""
    del warm_ace
    assert cost_of(TOURS, tmp_path) == 5 + 5 + 1 - 6
    assert cost_of(TOURS.replace("tours: yes\n", ""), tmp_path) == 1 + 1
    assert cost_of(TOURS.replace("deadline: 6", "deadline: 7"), tmp_path) == 15 + 1 - 7
    assert cost_of(TOURS.replace("deadline: 6", "deadline: 3.5").replace("0, 0]", "0, 0], speed: 2"), tmp_path) == 9


def test_where_a_deadline_asks_for_it_the_tour_is_longer(tmp_path: Path, warm_ace: None) -> None:
    del warm_ace
    text = """tours: yes
robots:
  ann: {at: [5, 0]}
tasks:
  left: {at: [1, 0], worth: 100}
  right: {at: [8, 0], worth: 100, deadline: DEADLINE}
"""
    assert cost_of(text.replace("DEADLINE", "99"), tmp_path) == 200 - (3 + 7)
    assert cost_of(text.replace("8, 0]", "10, 0]").replace("DEADLINE", "99"), tmp_path) == 200 - (4 + 9)
    assert cost_of(text.replace("8, 0]", "10, 0]").replace("DEADLINE", "12"), tmp_path) == 200 - (5 + 9)


@pytest.mark.parametrize("protocol", ["ssi", "cbba"])
def test_auctions_bid_what_a_task_adds_to_the_tour(protocol: str, tmp_path: Path, warm_ace: None) -> None:
    del warm_ace
    assert cost_of(TOURS, tmp_path, protocol) == 5


def test_of_one_task_each_a_tour_is_the_way_there(tmp_path: Path) -> None:
    text = TOURS.replace("{at: [0, 0]}", "{at: [0, 0], most: 1}")
    assert imported(text, tmp_path).team == imported(text.replace("tours: yes\n", ""), tmp_path).team


def test_too_many_sets_of_tasks_are_refused_at_once(tmp_path: Path) -> None:
    tasks = "".join(f"  t{place}: {{at: [{place}, 0], worth: 1}}\n" for place in range(40))
    text = f"tours: yes\nrobots:\n  ann: {{at: [0, 0], most: MOST}}\ntasks:\n{tasks}"
    said = mistakes(text.replace("MOST", "40"), tmp_path)
    assert "the robot 'ann' has time and capacity for more than 4,096 sets of tasks (write most:" in said
    assert said.startswith("3: ")
    assert len(imported(text.replace("MOST", "2"), tmp_path).team["ann"].variables) == 41  # and the tour
    hurried = text.replace("MOST", "40").replace("worth: 1", "worth: 1, deadline: 0.5")
    assert imported(hurried, tmp_path).team["ann"].variables


def test_tours_are_yes_or_no(tmp_path: Path) -> None:
    assert "cannot have 'often' as 'tours' (write tours: yes, or tours: no)" in mistakes(
        TOURS.replace("tours: yes", "tours: often"), tmp_path
    )
    assert cost_of(TOURS.replace("tours: yes", "tours: no"), tmp_path) == 2
