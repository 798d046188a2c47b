"""Who needs least, in words."""

from __future__ import annotations

from typing import Any

from robochoc.experiments.ranking import answers


def row(label: str, problem: int, messages: int | None, **more: object) -> dict[str, Any]:
    given = {
        "label": label, "digest": str(problem), "seed": 0, "repetition": 1, "messages": messages, "ncccs": 7,
        "bytes": 7, "cost": None, "maximises": False, "status": "limit" if messages is None else "done",
    }  # fmt: skip
    return {**given, **more}


def test_who_needs_least_in_how_many_cases() -> None:
    given = [row("a", 1, 5), row("b", 1, 9), row("a", 2, 5), row("b", 2, 4), row("a", 3, None), row("b", 3, 99)]
    assert answers(given, ["messages", "ncccs"]) == [
        "Least messages: b in 2, a in 1 of 3 cases.",
        "Least NCCCs: b in 3, a in 2 of 3 cases, ties counted for each.",
    ]
    assert answers(given[::2], ["messages"]) == []


def test_a_tie_is_a_win_of_both_and_what_all_need_is_not_told() -> None:
    given = [row(way, 1, 3) for way in "ab"] + [row("c", 1, 4)]
    assert answers(given, ["messages"]) == [
        "Least messages: a in 1, b in 1 of 1 cases, ties counted for each.",
        "a and b are the same in all runs.",
    ]
    assert answers(given[:2], ["messages"]) == ["a and b are the same in all runs."]


def test_a_case_that_nobody_has_solved_is_none() -> None:
    assert answers([row("a", 1, None), row("b", 1, None, ncccs=8)], ["messages"]) == []


def test_higher_utilities_are_better() -> None:
    given = [row("a", 1, 3, cost=10, maximises=True), row("b", 1, 3, cost=12, maximises=True)]
    assert answers(given, ["cost"]) == ["Best cost: b in 1 of 1 cases."]


def test_others_are_counted() -> None:
    given = [row(way, problem, 1 + (way != "abcde"[problem])) for way in "abcde" for problem in range(5)]
    assert answers(given, ["messages"])[0].endswith("of 5 cases, 2 others in no more.")
