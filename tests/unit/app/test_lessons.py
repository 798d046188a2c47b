"""The lessons: each is well-formed, and what it says is what the protocols do."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from robochoc.app.lessons.lesson import COUNT, ROBOTS, Lesson, LessonStep, lesson
from robochoc.app.lessons.picture import HEIGHT, WIDTH, picture
from robochoc.app.lessons.progress import LessonProgress
from robochoc.app.lessons.record import recorded
from robochoc.app.lessons.recording import LessonRun, after, before, reasons, recordings
from tests.support.cases import looped
from tests.support.lesson_truth import breaks, is_true

NUMBERS = range(1, COUNT + 1)


def steps() -> list[tuple[int, LessonStep]]:
    """All steps of all lessons, each with its lesson's number."""
    return [(number, step) for number in NUMBERS for step in lesson(number).steps]


@looped("number", NUMBERS)
def test_a_lesson_is_of_four_to_seven_steps_with_one_answer_each(number: int) -> None:
    taught = lesson(number)
    assert 4 <= len(taught.steps) <= 7
    for step in taught.steps:
        assert 3 <= len(step.choices) <= 4
        assert sum(choice.right for choice in step.choices) == 1
        assert len({choice.shown for choice in step.choices}) == len(step.choices)
        assert all(choice.why for choice in step.choices)


def test_the_answer_is_not_always_at_the_same_place() -> None:
    places = [step.choices.index(step.answer) for _, step in steps()]
    assert all(places.count(place) < len(places) / 2 for place in range(4))


def test_there_are_no_lessons_but_these() -> None:
    for number in (0, COUNT + 1, -1):
        with pytest.raises(KeyError):
            lesson(number)


@looped("number", NUMBERS)
def test_the_recorded_runs_are_what_the_protocols_do_today(number: int) -> None:
    assert recordings(number) == recorded(lesson(number))


@looped(("number", "step"), steps)
def test_the_answer_is_true_and_the_other_choices_are_not(number: int, step: LessonStep) -> None:
    taught, runs = lesson(number), recordings(number)
    for choice in step.choices:
        assert is_true(taught, runs, step, choice) == choice.right, choice.shown
        if choice.levels and not choice.right:
            assert breaks(taught.team_of(step), choice)


def test_what_protocols_no_longer_say_is_noticed() -> None:
    taught = lesson(3)
    runs = recordings(3)
    run = runs["abt"]
    others = {"abt": LessonRun(run.protocol, messages=run.messages[::-1], turns=run.turns)}
    assert not any(is_true(taught, others, step, step.answer) for step in taught.steps[:2])


@looped(("number", "step"), steps)
def test_pictures_are_well_formed_and_show_levels_messages_and_names(number: int, step: LessonStep) -> None:
    team = lesson(number).team_of(step)
    for moment in (before(number, step), after(number, step)):
        drawn = picture(team, moment)
        assert "\n\n" not in drawn
        root = ET.fromstring(drawn)  # noqa: S314 - ours
        words = [text for one in root.iter() if one.tag.endswith("text") for text in one.itertext()]
        if not team.chain:
            assert {*ROBOTS} <= {*words}
            assert {str(level) for level in moment.levels.values()} <= {*words}
        assert {message.kind for message in moment.messages} <= {*words}
        assert all(message.words in root.attrib["aria-label"] for message in moment.messages)
        for one in root.iter():
            assert 0 <= float(one.attrib.get("cx", 0)) <= WIDTH
            assert 0 <= float(one.attrib.get("y", 0)) <= HEIGHT


def test_a_robots_reasons_come_from_the_replay() -> None:
    taught: Lesson = lesson(3)
    assert "no value was left, and it said Nogood to Bob: while Ada.level = 1: Bob.level != 2" in reasons(
        3, taught.steps[0]
    )


def test_progress_is_kept(tmp_path: Path) -> None:
    progress = LessonProgress(tmp_path)
    assert progress.next() == 1
    for step in range(len(lesson(1).steps)):
        assert not progress.is_over(1)
        progress.answered(1, step)
    progress.answered(1, 0)
    again = LessonProgress(tmp_path)
    assert again.is_over(1)
    assert again.next() == 2
    again.restart(1)
    assert LessonProgress(tmp_path).done(1) == 0


@looped("content", [b"", b"{", b"[]", b'{"1":"x"}', b'{"1":-5}', b'{"99":3}'])
def test_a_damaged_file_of_progress_is_begun_again(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "lessons.json").write_bytes(content)
    assert LessonProgress(tmp_path).done(1) == 0


def test_a_folder_that_cannot_be_written_ends_no_lesson(tmp_path: Path) -> None:
    progress = LessonProgress(tmp_path / "gone")
    progress.answered(1, 0)
    assert progress.done(1) == 1
