"""The seed of the tests' random problems."""

from __future__ import annotations

import pytest

from tests.support import examples


def test_problems_follow_their_name_and_the_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    def draw(name: str, seed: str | None) -> float:
        monkeypatch.setattr(examples, "_seed", "")  # restored after the test
        examples.use_seed(seed)
        return examples.drawn(name).random()

    assert draw("costs abt 1", "7") == draw("costs abt 1", "7")
    assert len({draw(name, seed) for name in ("costs abt 1", "costs abt 2") for seed in (None, "7", "8")}) == 6
