"""The tool for tests of many cases."""

import os
from pathlib import Path

import pytest

from tests.support.cases import cases, looped


def test_all_failing_cases_are_named() -> None:
    def four_cases() -> None:
        with cases() as each:
            for number in range(4):
                with each(number):
                    if number == 3:
                        pytest.fail("odd")
                    assert number % 2 == 0

    with pytest.raises(ExceptionGroup, match="2 of 4 cases failed: 1, 3") as raised:
        four_cases()
    assert [type(error) for error in raised.value.exceptions] == [AssertionError, AssertionError]


def test_an_empty_table_is_an_error() -> None:
    with pytest.raises(AssertionError, match="no case was tried"), cases():
        pass


def test_a_case_that_is_skipped_hides_no_failure() -> None:
    def two_cases() -> None:
        with cases() as each:
            for name, end in (("first", pytest.fail), ("second", pytest.skip)):
                with each(name):
                    end("here")

    with pytest.raises(ExceptionGroup, match="1 of 2 cases failed: first"):
        two_cases()


def test_passing_cases_pass() -> None:
    with cases() as each, each("a"):
        pass


@looped(("text", "length"), [("one", 3), ("three", 5)])
def test_rows_have_folders_of_their_own(tmp_path: Path, text: str, length: int) -> None:
    assert not list(tmp_path.iterdir())
    (tmp_path / text).touch()
    assert len(text) == length


def test_a_failing_row_is_named() -> None:
    tried = []

    @looped("number", lambda: [1, 2, 3])
    def is_odd(number: int) -> None:
        tried.append(number)
        assert number % 2

    with pytest.raises(ExceptionGroup, match="1 of 3 cases failed: 1 2"):
        is_odd()
    assert tried == [1, 2, 3]


@looped("value", ["first", "second"])
def test_what_a_row_replaces_is_put_back(monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    assert os.environ.get("ROW") is None
    monkeypatch.setenv("ROW", value)
