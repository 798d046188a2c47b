"""A scene's page in a browser: what it shows, asked from outside."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from robochoc.flight.log import FlightLog
from robochoc.flight.mission import mission_of
from robochoc.view.scene import Scene, scene_of
from tests.support.browser_pages import Browser, Page, watched_page
from tests.support.flights import LEG_S, epochs_of_three, five, straight
from tests.support.sniffer_pages import until

WINDOW = {"width": 700, "height": 560}
HOSTILE = "</script><img src=x onerror=document.title='broken'>"
END_S = 3 * LEG_S


def scene(**how: Any) -> Scene:  # noqa: ANN401 - `straight`'s
    outcome = epochs_of_three(HOSTILE)
    mission = mission_of(outcome, five())
    flown: FlightLog = straight(mission, **how)
    return scene_of(outcome, mission, flown)


@contextmanager
def opened(browser: Browser, url: str, **options: Any) -> Iterator[Page]:  # noqa: ANN401 - Playwright's
    """The page, once it is drawn. No script may complain, and nothing may be asked for anything."""
    with watched_page(browser, **{"viewport": WINDOW, **options}) as (page, _, asked):
        page.goto(url)
        until(lambda: page.evaluate("Boolean(globalThis.Playback)"), "it does not begin")
        yield page
        assert page.locator("#trouble").is_hidden()
    assert not [one for one in asked if not one.startswith((url, "data:", "blob:"))]


def now(page: Page) -> float:
    time: float = page.evaluate("Playback.player.time")
    return time


def place(page: Page, drone: int) -> list[float]:
    """Where a drone is, as it is drawn: x, y and z in cells."""
    at: list[float] = page.evaluate(f"Playback.drones[{drone}].position.toArray()")
    return at


def pressed(page: Page) -> str | None:
    """The camera's button that is pressed."""
    names: list[str] = page.eval_on_selector_all(".joined [aria-pressed=true]", "all => all.map((one) => one.id)")
    return names[0] if names else None
