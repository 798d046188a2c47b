"""Names that are scripts, markup, escapes and paths, wherever a sketch has one, on every page: never executed."""

from __future__ import annotations

from http.client import HTTPConnection
from itertools import product

from robochoc.app.sketch.history import History
from robochoc.app.sketch.sketch import Area, Cell, Decision, DecisionKind, Sketch, SketchRobot, SketchRule
from robochoc.app.store import TeamStore
from robochoc.app.texts import say
from tests.support.app_server import AppServer
from tests.support.browser_pages import Browser, connected, watched_page
from tests.support.cases import cases
from tests.support.hostile_client import NAMES
from tests.support.limits import HANG_S

AREAS = ("model", "decide", "whatif", "fly", "compare", "play")
LONG = "n" * 10_000
TEXTS = (*(name for name in NAMES if name.strip()), LONG)
PAINTED = "document.title = 'painted'; globalThis.executed = true"
SCRIPTS = (f'<img src=x onerror="{PAINTED}">', f'x" :onx="{PAINTED}" innerHTML="<img src=x onerror=\'{PAINTED}\'>')


def _sketch(text: str) -> Sketch:
    """A sketch that has `text` wherever a text can stand. No edit makes it: somebody has written the file."""
    robots = tuple(SketchRobot(f"{text}{number}", Cell(number, 0)) for number in range(3))
    slot, task = (
        Decision(f"{text}s", DecisionKind.SLOT, (1, 2, 3)),
        Decision(f"{text}t", DecisionKind.TASK, (text, f"{text}2")),
    )
    rules = (
        SketchRule(f"{text}a", "different", slot.name),
        SketchRule(f"{text}b", "only", task.name, (robots[0].name,), {"values": [text]}),
        SketchRule(f"{text}c", text, slot.name, (text,), {text: text}),
    )
    return Sketch(text, Area(4, 2), robots, (slot, task), rules, text)


def _kept(teams: TeamStore, text: str) -> str:
    team = teams.add(Sketch())
    teams.save(team, History(_sketch(text)))
    return team


def test_no_name_is_executed(browser: Browser, application: AppServer, teams: TeamStore) -> None:
    with watched_page(browser, may_complain=True) as tab, cases() as each:
        for text, area in product(SCRIPTS, ("", *AREAS)):
            with each((area, text)):
                tab.complaints.clear()
                team = _kept(teams, text)
                connected(tab.page, f"{application.url}team/{team}/{area}" if area else application.url)
                tab.page.wait_for_selector("h1, h2, .toolbar")
                assert not tab.page.evaluate("globalThis.executed")
                assert tab.page.locator("img").count() == 0
                assert tab.page.title() != "painted"
                assert [one for one in tab.complaints if "Error" in one] == []
                teams.remove(team)


def test_no_name_breaks_a_page(application: AppServer, teams: TeamStore) -> None:
    connection = HTTPConnection("127.0.0.1", application.port, timeout=HANG_S)
    for number, text in enumerate(TEXTS):
        team = _kept(teams, text)
        for area in AREAS[number % 3 :: 3]:
            connection.request("GET", f"{application.path}team/{team}/{area}")
            answer = connection.getresponse()
            page = answer.read().decode()
            assert (answer.status, say("app.fault-page") in page) == (200, False), (area, text[:50])
        teams.remove(team)
    connection.close()
