"""The page in other browsers: narrow, dark, with little motion; without a flight; served while it is made."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from robochoc.view.page import scene_page
from robochoc.view.scene import Scene
from tests.support.browser_pages import Browser, Page
from tests.support.live_scenes import served_scene
from tests.support.scene_pages import END_S, now, opened, place, pressed, scene
from tests.support.sniffer_pages import CONTRAST, until


@pytest.fixture(scope="module")
def small(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A telephone at night, of one who wants little motion; the last two epochs begin at the same time."""
    whole = scene()
    playback = whole.playback
    assert playback
    first, second, third = playback.chapters
    playback = replace(playback, chapters=(first, second, replace(third, begins_s=second.begins_s)))
    html = tmp_path_factory.mktemp("small") / "page.html"
    html.write_bytes(scene_page(replace(whole, playback=playback)))
    screen = {"width": 360, "height": 640}
    with opened(browser, html.as_uri(), viewport=screen, color_scheme="dark", reduced_motion="reduce") as shown:
        yield shown


def test_with_little_motion_it_begins_at_its_end(small: Page) -> None:
    assert now(small) == END_S
    assert not small.evaluate("Playback.player.playing")
    small.keyboard.press("2")
    assert pressed(small) == "top"
    assert small.evaluate("Playback.camera.turning") is None


def test_epochs_that_begin_together_are_told_together(small: Page) -> None:
    said = small.inner_text("#epoch")
    assert "Epoch 1 (0 to 2)" in said
    assert "Epoch 2 (0 to 2)" in said
    boxes = [small.locator("#marks button").nth(number).bounding_box() for number in range(3)]
    assert boxes[1]["x"] + boxes[1]["width"] <= boxes[2]["x"] + 0.5


def test_labels_and_legend_can_be_read_on_a_narrow_page(small: Page) -> None:
    high = """Playback.labels.names.filter((name) => name.visible).map((name) => {
      const [at, size] = [new MeshCat.THREE.Vector3(), new MeshCat.THREE.Vector3()];
      const lens = Playback.viewer.camera;
      const depth = -name.getWorldPosition(at).applyMatrix4(lens.matrixWorldInverse).z;
      const height = name.getWorldScale(size).y * name.children[0].scale.y;
      return height * innerHeight / 2 / depth / Math.tan(lens.fov * Math.PI / 360);
    })"""
    until(lambda: small.evaluate(high), "no drone has a label")
    assert min(small.evaluate(high)) > 15
    assert small.locator("#legend li").count() >= 5
    assert small.evaluate(
        "document.getElementById('legend').scrollWidth <= document.getElementById('caption').clientWidth"
    )


def test_a_narrow_dark_page_has_room_for_all(small: Page) -> None:
    assert small.evaluate("document.documentElement.scrollWidth") == 360
    boxes = [small.locator(f"#{name}").bounding_box() for name in ("caption", "controls")]
    for box in boxes:
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= 360
    assert boxes[1]["y"] - boxes[0]["y"] - boxes[0]["height"] > 250
    outside = small.eval_on_selector_all(
        "#controls button, #controls select, #controls input",
        "all => all.filter((one) => { const box = one.getBoundingClientRect();"
        " return box.left < 0 || box.right > innerWidth || box.bottom > innerHeight; }).map((one) => one.id)",
    )
    assert outside == []
    assert small.evaluate(CONTRAST) == []
    small.click("#keys summary")
    keys = small.locator("#keys dl").bounding_box()
    assert keys["x"] >= 0
    assert keys["x"] + keys["width"] <= 360


def test_without_a_flight_there_is_nothing_to_play(browser: Browser, tmp_path: Path) -> None:
    bare = Scene("a team: a solution", (("flight", "none"),), scene().drones, scene().axes)
    html = tmp_path / "page.html"
    html.write_bytes(scene_page(bare))
    with opened(browser, html.as_uri(), reduced_motion="reduce") as shown:
        assert shown.locator("#play").is_hidden()
        assert shown.locator("#time").is_hidden()
        shown.keyboard.press("4")
        assert pressed(shown) == "follow"
        shown.keyboard.press(" ")
        assert place(shown, 0) == pytest.approx(bare.drones[0].end)


def test_the_live_page_plays_the_same(browser: Browser) -> None:
    with served_scene(scene()) as url, opened(browser, url) as live:
        until(lambda: live.evaluate("Boolean(Playback.trails.mesh)"), "nothing to play has come")
        assert live.evaluate("Playback.player.playing || Playback.player.ended"), "by itself"
        live.evaluate("Playback.player.pause(); Playback.player.seek(4.5)")
        assert live.inner_text("#epoch").startswith("Epoch 2 (0 to 2)")
        assert place(live, 0) != pytest.approx(place(live, 1), abs=0.5)
        assert pressed(live) == "overview"
        away = "Playback.viewer.camera.position.length()"
        assert live.evaluate(away) > 2, "as the window wants it"
