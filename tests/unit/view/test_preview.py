"""What is flown for a picture as it is drawn, not to scale; and what is not flown for one."""

from __future__ import annotations

from robochoc.flight.mission import mission_of
from robochoc.model.outcome import EpochOutcome, Outcome, Verdict
from tests.support.cases import looped
from tests.support.flights import scene_of


@looped(
    ("values", "scale"),
    [({"V1.1": 1, "V1.2": 10**12}, None), ({"V1.1": 1, "V1.2": 2}, 1e9), ({"V1.1": 10**7, "V1.2": 10**7 + 1}, None)],
)
def test_what_is_flown_in_cells_is_said_not_to_be_to_scale(values: dict[str, int], scale: float | None) -> None:
    outcome = Outcome("vast", "abt", "simulator", 0, Verdict.SOLUTION, values)
    scene = scene_of(outcome, mission=mission_of(outcome, None, scale))
    facts = dict(scene.facts)
    assert scene.playback
    assert scene.playback.duration_s < 10
    assert facts["flown"].endswith(" s, not to scale")
    assert "separation" not in facts


def test_more_epochs_than_are_flown_for_a_picture() -> None:
    many = tuple(EpochOutcome(Verdict.SOLUTION, (), assignment={"V1.1": number % 3 + 1}) for number in range(100))
    scene = scene_of(Outcome("many", "dynabt", "simulator", 0, Verdict.SOLUTION, {"V1.1": 1}, epochs=many))
    assert scene.playback is None
    assert dict(scene.facts)["flight"].startswith("none: 1 drone in 100 epochs")
