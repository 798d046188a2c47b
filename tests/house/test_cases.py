"""The tool for tests of many cases."""

import pytest

from tests.support.cases import cases


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


def test_passing_cases_pass() -> None:
    with cases() as each, each("a"):
        pass
