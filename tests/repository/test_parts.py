"""The part of the slow tests that CI runs."""

from __future__ import annotations

from tests.support.parts import in_part


def test_one_of_n_by_name() -> None:
    names = [f"tests/test_any.py::test_it[{number}]" for number in range(3_000)]
    assert all(in_part(name, 1) for name in names)
    third = [name for name in names if in_part(name, 3)]
    assert 900 < len(third) < 1_100
    assert third == [name for name in names if in_part(name, 3)]
