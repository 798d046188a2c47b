"""The sniffer's page in a browser: what the journal says is what it shows, by mouse and by keys."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from robochoc.replay.robot_states import states_of
from tests.support.browser_pages import Page
from tests.support.sniffer_pages import (
    ALL,
    COUNT,
    FEED,
    JOURNAL,
    TRACE,
    begin_again,
    choose,
    heads,
    painted,
    robot,
    rows,
    text_is,
    until,
)
from tests.support.sniffer_server import SnifferServer

pytestmark = pytest.mark.usefixtures("without_the_scenes_viewer")


@pytest.fixture
def page(tab: Page) -> Page:
    """The page as it begins. One tab of the browser is enough for all."""
    begin_again(tab)
    return tab


@pytest.fixture
def loaded(tab: Page, server: SnifferServer) -> Page:
    """The same, loaded anew: nothing has the focus."""
    tab.goto("about:blank")
    tab.goto(server.url)
    text_is(tab, "#counts", ALL)
    return tab


# Lifelines, robots, filters


def test_every_robot_has_a_lifeline_and_every_message_a_row(page: Page) -> None:
    assert heads(page) == TRACE.robots
    assert page.get_attribute("#grid", "aria-rowcount") == str(COUNT + 1)
    assert rows(page)[:3] == [0, 1, 2]
    assert page.get_attribute("#grid .row[data-message='2']", "aria-rowindex") == "4"
    assert painted(page) > 100
    assert page.inner_text("#verdict") == FEED.news()["verdict"]


def test_robots_are_chosen_grouped_and_reordered(page: Page) -> None:
    page.fill("#robots input[type=search]", "Robot2.*")
    page.get_by_role("button", name="Only these").click()
    of = TRACE.messages
    second = {number for number, name in enumerate(TRACE.robots) if name.startswith("Robot2.")}
    left = sum(sender in second or receiver in second for sender, receiver in zip(of.sender, of.receiver, strict=True))
    text_is(page, "#counts", f"{left} of {ALL}")
    assert heads(page) == ["Robot2.1", "Robot2.2", "Robot2.3", "Robot2.4", "others"]
    page.locator(".head").nth(1).focus()
    page.keyboard.press("Alt+ArrowLeft")
    until(lambda: heads(page)[:2] == ["Robot2.2", "Robot2.1"], "it did not move")
    page.get_by_role("button", name="One lifeline for Robot2.*").click()
    until(lambda: heads(page) == ["Robot2.*", "others"], "the group has no lifeline")
    page.locator(".head").first.click()
    until(lambda: len(heads(page)) == 5, "the group does not open")
    page.get_by_role("button", name="Reset").click()
    until(lambda: heads(page) == TRACE.robots, "not as at first")


def test_all_and_none_are_of_all_robots_whoever_is_found(page: Page) -> None:
    page.fill("#robots input[type=search]", "Robot2.*")
    page.get_by_role("button", name="None", exact=True).click()
    until(lambda: heads(page) == ["others"], "some are chosen")
    page.get_by_role("button", name="All", exact=True).click()
    until(lambda: heads(page) == TRACE.robots, "some are not chosen")


def test_only_neighbours(page: Page) -> None:
    page.locator(".head").first.click()
    page.get_by_role("button", name="Only neighbours").click()
    of = TRACE.messages
    pairs = set(zip(of.sender, of.receiver, strict=True))
    spoken = {one for pair in pairs for one in pair if robot("Robot1.1") in pair}
    until(lambda: set(heads(page)) - {"others"} == {TRACE.robots[one] for one in spoken}, "others than the neighbours")


def test_a_head_is_dragged(page: Page) -> None:
    first, third = (page.locator(".head").nth(at).bounding_box() for at in (0, 2))
    page.mouse.move(first["x"] + 15, first["y"] + 15)
    page.mouse.down()
    page.mouse.move(third["x"] + third["width"] + 1, third["y"] + 15, steps=5)
    page.mouse.up()
    until(lambda: heads(page)[:3] == ["Robot1.2", "Robot1.3", "Robot1.1"], "it was not moved")


def test_filters_leave_out_what_they_say(page: Page) -> None:
    kinds = [TRACE.kinds[kind] for kind in TRACE.messages.kind]
    page.click("#tab-filters")
    page.get_by_role("checkbox", name=re.compile("^Ok")).uncheck()
    text_is(page, "#counts", f"{COUNT - kinds.count('Ok')} of {ALL}")
    assert {kinds[message] for message in rows(page)} == {"Nogood", "AddLink"} - ({"AddLink"} - set(kinds[:300]))
    page.get_by_label("From", exact=True).first.fill("Robot4.*")
    left = sum(
        kind != "Ok" and TRACE.robots[sender].startswith("Robot4.")
        for kind, sender in zip(kinds, TRACE.messages.sender, strict=True)
    )
    text_is(page, "#counts", f"{left} of {ALL}")
    page.get_by_role("button", name="Show all messages").click()
    text_is(page, "#counts", ALL)


def test_only_what_concerns_a_message(page: Page) -> None:
    message = next(m for m in range(300, COUNT) if TRACE.causes(m) and TRACE.consequences(m))
    choose(page, message)
    page.click("#tab-filters")
    page.get_by_label("Which messages, by cause and consequence").select_option("1")
    concerned = {message, *TRACE.causes(message), *TRACE.consequences(message)}
    text_is(page, "#counts", f"{len(concerned)} of {ALL}")


def test_search_goes_through_what_is_said(page: Page) -> None:
    page.fill("#query", "cannot")
    hits = [m for m in range(COUNT) if "cannot" in f"{FEED.detail(m)['words']} {json.dumps(FEED.detail(m)['content'])}"]
    assert hits
    text_is(page, "#hits", str(len(hits)))
    page.press("#query", "Enter")
    text_is(page, "#hits", f"1 of {len(hits)}")
    page.press("#query", "Shift+Enter")
    text_is(page, "#hits", f"{len(hits)} of {len(hits)}")
    assert page.inner_text("#message h2").startswith(f"{hits[-1]} ")


# One message, one robot, one moment


def test_the_reasons_for_a_nogood(page: Page) -> None:
    sender = TRACE.messages.sender
    message = next(m for m in range(COUNT) if TRACE.kinds[TRACE.messages.kind[m]] == "Nogood")
    choose(page, message)
    page.wait_for_selector("#message .why")
    step = list(states_of(JOURNAL, TRACE.robots[sender[message]]))[
        sum(TRACE.steps.robot[one] == sender[message] for one in range(TRACE.messages.step[message]))
    ]
    assert any(line.startswith("no value was left") for line in step.why)
    assert page.locator("#message .why li").all_inner_texts() == step.why
    choose(page, 0)
    until(lambda: "no value was left" not in page.inner_text("#message"), "the reasons of another message")


def test_a_message_in_full(page: Page, tmp_path: Path) -> None:
    page.click("#grid .row[data-message='5']")
    detail = FEED.detail(5)
    text_is(page, "#message blockquote", detail["words"])
    facts = page.locator("#message dl").last.inner_text()
    assert all(name in facts and value in facts for name, value in detail["fields"].items())
    assert page.eval_on_selector("#message pre", "pre => pre.textContent") == detail["acl"]
    later = next(m for m in range(200, COUNT) if TRACE.causes(m) and TRACE.consequences(m))
    choose(page, later)
    linked = page.eval_on_selector_all("#message .links b", "all => all.map((one) => one.textContent)")
    assert linked == [f"{m:,}" for m in (*TRACE.causes(later), *TRACE.consequences(later))]
    page.locator("#message .link").first.click()
    until(lambda: page.inner_text("#message h2").startswith(f"{TRACE.causes(later)[0]:,} "), "no cause")
    assert page.get_attribute("#grid", "aria-activedescendant") is not None
    with page.expect_download() as coming:
        page.get_by_role("button", name="ACL text").click()
    coming.value.save_as(tmp_path / "saved")
    assert (tmp_path / "saved").read_text() == FEED.detail(TRACE.causes(later)[0])["acl"] + "\n"
    page.get_by_label("Messages to save").select_option("shown")
    with page.expect_download() as coming:
        page.get_by_role("button", name="JSON").click()
    coming.value.save_as(tmp_path / "all")
    assert coming.value.suggested_filename.endswith(".json")
    entries = json.loads((tmp_path / "all").read_text())
    assert {entry["run"] for entry in entries} == {1}
    assert [entry["number"] for entry in entries] == list(range(COUNT))
    assert [entry["content"] for entry in entries] == [TRACE.content(m) for m in range(COUNT)]


def test_a_robot_at_a_moment_is_what_replay_says(page: Page) -> None:
    name = "Robot3.1"
    own = [step for step, number in enumerate(TRACE.steps.robot) if number == robot(name)]
    states = list(states_of(JOURNAL, name))
    page.get_by_role("button", name=re.compile(f"^{name}:")).click()
    for at in (4, 2):
        page.evaluate(f"Sniffer.page.time.go({own[at]})")
        state = states[at]
        until(lambda: f"its step {at + 1} of {len(own)}" in page.inner_text("#robot"), "another step")  # noqa: B023
        page.wait_for_selector("#robot .knows")
        said = page.inner_text("#robot")
        view = (f"{who}\n{text}" for who, text in state.view)
        for line in (*state.nogoods, *view, *(one.value for one in state.domain)):
            assert line in re.sub(r"\n+", "\n", said)
        assert f"{sum(not one.ruled_out_by for one in state.domain)} of {len(state.domain)} left" in said
        assert page.inner_text("#robot .value") == ", ".join(f"{key} = {value}" for key, value in state.value.items())
    page.locator("#robot button", has_text="Step").last.click()
    until(lambda: f"its step 4 of {len(own)}" in page.inner_text("#robot"), "no next step")
    assert page.get_attribute("#moment", "aria-valuetext").startswith(f"step {own[3] + 1} of")


def test_values_over_lifelines_are_those_of_the_moment(page: Page) -> None:
    values: dict[str, str] = {}
    moment = len(TRACE.steps.t) // 2
    for step, assignment in TRACE.decisions:
        if step <= moment:
            values[TRACE.robots[TRACE.steps.robot[step]]] = ", ".join(f"{a} = {b}" for a, b in assignment.items())
    page.evaluate(f"Sniffer.page.time.go({moment})")
    labels = "all => all.map((head) => head.getAttribute('aria-label').split(';')[0])"
    expected = [f"{name}: {values.get(name) or 'no value'}" for name in TRACE.robots]
    until(lambda: page.eval_on_selector_all(".head", labels) == expected, "other values")


def test_it_plays(page: Page) -> None:
    page.select_option("#speed", "15")
    page.click("#play")
    page.wait_for_selector("#play[aria-label=Pause]")
    until(lambda: 0 < int(page.input_value("#moment")) < len(TRACE.steps.t) - 1, "the moment stands still")
    page.select_option("#speed", "500")
    page.wait_for_selector("#play[aria-label=Play]")
    assert page.input_value("#moment") == str(len(TRACE.steps.t) - 1)


# The view stays, keys do everything


def test_a_reload_shows_the_same(loaded: Page) -> None:
    page = loaded
    page.fill("#robots input[type=search]", "Robot1.*")
    page.get_by_role("button", name="Only these").click()
    page.click("#tab-filters")
    page.get_by_role("checkbox", name=re.compile("^Nogood")).uncheck()
    choose(page, 20)
    page.click("#display summary")
    page.select_option("#colour", "sender")
    page.click("#zoom-in")
    written = ("rowHeight=30", "selected=20", "colourBy=sender")
    until(lambda: all(part in page.evaluate("location.hash") for part in written), "not written")
    before = (page.inner_text("#counts"), heads(page), page.inner_text("#message h2"), page.inner_text("#when"))
    page.reload()
    text_is(page, "#counts", before[0])
    until(lambda: page.inner_text("#message h2") == before[2], "another message")
    assert (page.inner_text("#counts"), heads(page), page.inner_text("#message h2"), page.inner_text("#when")) == before
    assert page.input_value("#colour") == "sender"


def test_keys_alone(loaded: Page) -> None:
    page = loaded
    press = page.keyboard.press
    press("Tab")
    press("Enter")
    assert page.evaluate("document.activeElement.id") == "grid"
    for key, message in (("j", 0), ("ArrowDown", 1), ("k", 0), ("End", COUNT - 1), ("Home", 0)):
        press(key)
        until(lambda: page.inner_text("#message h2").startswith(f"{message:,} "), f"{key} goes elsewhere")  # noqa: B023
    press("v")
    first = TRACE.consequences(0)[0]
    until(lambda: page.inner_text("#message h2").startswith(f"{first:,} "), "no consequence")
    press("c")
    until(lambda: page.inner_text("#message h2").startswith(f"{TRACE.causes(first)[0]:,} "), "no cause")
    press("ArrowRight")
    press("ArrowLeft")
    press("]")
    own = [step for step, number in enumerate(TRACE.steps.robot) if number == robot("Robot1.1")]
    until(lambda: page.input_value("#moment") == str(own[1]), "no step of the robot's own")
    press("Enter")
    assert page.evaluate("document.activeElement.id") == "message"
    press("Escape")
    assert page.evaluate("document.activeElement.id") == "grid"
    press("/")
    assert page.evaluate("document.activeElement.id") == "query"
    press("Escape")
    press("?")
    assert page.locator("dialog").is_visible()
    press("Escape")
    assert not page.locator("dialog").is_visible()


def test_keys_work_wherever_the_focus_is_but_in_text(page: Page) -> None:
    page.locator("[name=layout][value=chart]").click(force=True)
    until(lambda: page.evaluate("document.activeElement.name") == "layout", "the choice takes no focus")
    page.keyboard.press("j")
    page.wait_for_selector("#message h2")
    until(lambda: page.inner_text("#message h2").startswith("0 "), "the choice of a layout keeps the key")
    page.click("#query")
    page.keyboard.press("j")
    assert page.input_value("#query") == "j"
    assert page.inner_text("#message h2").startswith("0 ")
