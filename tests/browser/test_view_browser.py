"""The page in a browser, which plays it: time, epochs, camera, trails, keys."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from robochoc.view.page import scene_page
from tests.support.browser_pages import Browser, Page
from tests.support.flights import LEG_S
from tests.support.scene_pages import END_S, HOSTILE, now, opened, place, pressed, scene
from tests.support.sniffer_pages import CONTRAST, NAMELESS, until


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    html = tmp_path_factory.mktemp("flown") / "page.html"
    html.write_bytes(scene_page(scene(falls={1: 3.0}, obstacles=((2.0, 1.0, 5.0),))))
    return html


@pytest.fixture(scope="module")
def one(browser: Browser, file: Path) -> Iterator[Page]:
    with opened(browser, file.as_uri(), reduced_motion="reduce") as page:
        yield page


@pytest.fixture
def player(one: Page) -> Iterator[Page]:
    """The page, paused at the beginning; its camera turns at once."""
    one.emulate_media(reduced_motion="reduce")
    one.evaluate("Playback.player.pause(); Playback.player.seek(0); Playback.camera.see('overview', true)")
    one.select_option("#speed", "1")
    one.select_option("#trail", "all")
    one.locator("#play").focus()
    one.evaluate("document.activeElement.blur()")
    drawn_again(one)  # where things are on the screen is known then
    yield one
    one.evaluate("Playback.player.pause()")  # what moves is painted again and again


def drawn_again(page: Page) -> None:
    """Wait until the page has drawn all that is so now."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def picture(page: Page) -> npt.NDArray[np.int16]:
    """The scene between caption and controls, as it is drawn: rows of red, green and blue."""
    drawn_again(page)
    page.evaluate("Playback.labels.choose()")  # which is done a few times a second: names may hide what is behind
    drawn_again(page)
    image = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    return np.asarray(image, dtype=np.int16)[20:400, 330:]


def test_the_drones_move(player: Page) -> None:
    begin = picture(player)
    player.keyboard.press("End")
    end = picture(player)
    for one in (begin, end):
        assert len(np.unique(one.reshape(-1, 3), axis=0)) > 500
    assert (np.abs(begin - end).max(axis=2) > 40).mean() > 0.005


DRAWN = """([joined, separate]) => {
  Playback.swarm.mesh.visible = joined;
  for (const body of Playback.swarm.bodies) body.children.find((child) => child.isMesh).visible = separate;
  Playback.viewer.set_dirty();
}"""


def test_joined_drones_look_like_separate_objects(player: Page) -> None:
    """In the air, with attitudes, and with the colours of rows and of a fallen drone."""
    player.evaluate("Playback.player.seek(4.2)")
    joined = picture(player)
    player.evaluate(DRAWN, [False, True])
    separate = picture(player)
    player.evaluate(DRAWN, [False, False])
    without = picture(player)
    player.evaluate(DRAWN, [True, False])
    assert (np.abs(joined - without).max(axis=2) > 20).sum() > 500
    assert (np.abs(joined - separate).max(axis=2) > 20).sum() < 100


def test_of_names_that_would_cover_each_other_one_is_written(player: Page) -> None:
    """That of the drone which is nearest, or which is followed."""

    def named() -> list[bool]:
        written: list[bool] = player.evaluate(
            "Playback.labels.choose(), Playback.labels.names.map((name) => name.visible)"
        )
        return written

    assert all(named())
    player.evaluate("Playback.drones[1].position.copy(Playback.drones[0].position)")
    assert sorted(named()[:2]) == [False, True]
    assert all(named()[2:])
    hidden = named().index(False)
    player.select_option("#drone", str(hidden))
    until(lambda: player.evaluate("!Playback.camera.turning"), "it does not turn there")
    assert named()[:2] == [hidden == 0, hidden == 1]
    player.click("#overview")
    player.evaluate("Playback.player.seek(1), Playback.player.seek(0)")
    until(lambda: player.evaluate("!Playback.camera.turning"), "it does not turn back")
    assert all(named())


def test_pictures_of_labels_are_loaded_when_they_are_first_visible(player: Page) -> None:
    picture = "({ visible, material: { map } }) => visible && map.image.complete && map.image.width > 20"
    loaded = f"Playback.labels.names.map((name) => name.children[0]).every({picture})"
    until(lambda: player.evaluate(loaded), "a picture is missing")
    pending = player.evaluate("""(() => {
      const [first, second] = Playback.labels.names;
      Playback.labels.pictures.set(first, first.children[0].material.map.image.src);
      Playback.drones[0].position.copy(Playback.drones[1].position);
      const [known, followed] = [Playback.labels.pictures, Playback.labels.followed];
      Playback.labels.followed = 1;
      Playback.labels.choose();
      const hidden = known.has(first);
      Playback.labels.followed = 0;
      Playback.labels.choose();
      Playback.labels.followed = followed;
      return [hidden, known.has(first), first.visible, second.visible];
    })()""")
    assert pending == [True, False, True, False]
    player.evaluate("Playback.player.seek(1), Playback.player.seek(0)")


SLOW, FAST = 1e-4, 1e4
"""Speeds at which the end is hours away, however busy the machine is, or a picture away."""


def run_at(page: Page, speed: float) -> None:
    page.evaluate(f"Playback.player.speed = {speed}")


def test_it_plays_to_its_end_and_again(player: Page) -> None:
    player.select_option("#speed", "4")
    assert player.evaluate("Playback.player.speed") == 4
    run_at(player, SLOW)
    assert player.get_attribute("#play", "aria-label") == "Play"
    player.click("#play")
    assert player.get_attribute("#play", "aria-label") == "Pause"
    until(lambda: 0 < now(player) < END_S, "it does not play")
    run_at(player, FAST)
    until(lambda: now(player) == END_S, "it does not end")
    assert player.get_attribute("#play", "aria-label") == "Play again"
    assert place(player, 0) == pytest.approx(scene().drones[0].end, abs=0.01)
    run_at(player, SLOW)
    player.keyboard.press("Home")
    player.locator("body").press(" ")
    until(lambda: 0 < now(player) < END_S, "it does not begin again")
    player.keyboard.press(" ")
    paused = now(player)
    drawn_again(player)
    assert now(player) == paused


def test_it_begins_anew(player: Page) -> None:
    run_at(player, SLOW)
    player.evaluate("Playback.player.seek(5)")
    player.click("#again")
    assert now(player) < 1
    assert player.evaluate("Playback.player.playing")


def test_the_slider_is_the_time(player: Page) -> None:
    line = player.locator("#time").bounding_box()
    player.mouse.click(line["x"] + line["width"] / 2, line["y"] + line["height"] / 2)
    assert now(player) == pytest.approx(END_S / 2, abs=0.05)
    assert player.inner_text("#clock") == f"{now(player):.1f} / 6.0 s"
    assert player.get_attribute("#time", "aria-valuetext").endswith("of 6.0 seconds, epoch 1 (0 to 2)")
    assert not player.evaluate("Playback.player.playing")


def test_steps_and_epochs_by_keys(player: Page) -> None:
    player.keyboard.press("ArrowRight")
    player.keyboard.press("ArrowRight")
    player.keyboard.press("ArrowLeft")
    assert now(player) == pytest.approx(0.1)
    player.keyboard.press("Shift+ArrowRight")
    assert now(player) == LEG_S
    player.keyboard.press("Shift+ArrowLeft")
    assert now(player) == 0
    player.keyboard.press("End")
    assert now(player) == END_S
    player.keyboard.press("-")
    assert player.input_value("#speed") == "0.5"
    for _ in range(9):
        player.keyboard.press("+")
    assert player.input_value("#speed") == "4"


def test_keys_step_while_the_slider_has_the_focus(player: Page) -> None:
    player.locator("#time").focus()
    player.keyboard.press("ArrowRight")
    assert now(player) == pytest.approx(0.1)
    player.keyboard.press("End")
    assert now(player) == END_S


def test_the_caption_tells_the_epoch(player: Page) -> None:
    said = ["the start: solution, 4 fly", "-R5.1: no solution, 3 hover on", "V2.1 without <2>: solution, 4 fly"]
    for number, words in enumerate(said):
        player.evaluate(f"Playback.player.seek({LEG_S * number + 0.5})")
        assert player.inner_text("#epoch").split("\n") == [f"Epoch {number} (0 to 2)", words]


def test_marks_say_what_happened_and_lead_there(player: Page) -> None:
    marks = player.locator("#marks button")
    labels = marks.evaluate_all("all => all.map((one) => one.getAttribute('aria-label'))")
    assert labels[1] == "Epoch 1: -R5.1, no solution, 3 hover on; at 2.0 s"
    assert labels[3] == "R2.1: motor 2 stopped; at 3.0 s"
    marks.nth(3).focus()
    assert player.inner_text("#hint") == "R2.1: motor 2 stopped (3.0 s)"
    player.keyboard.press("Enter")
    assert now(player) == 3
    player.evaluate("document.activeElement.blur()")
    assert player.locator("#hint").is_hidden()
    marks.nth(1).hover()
    assert player.inner_text("#hint").startswith("Epoch 1")
    marks.nth(1).click()
    assert now(player) == LEG_S


def test_cameras_by_keys_and_by_buttons(player: Page) -> None:
    def looked_from() -> list[float]:
        until(lambda: player.evaluate("!Playback.camera.turning"), "it turns for ever")
        return list(player.evaluate("Playback.viewer.camera.position.toArray()"))

    overview = looked_from()
    takes = player.evaluate("Playback.camera.constructor.TURN")
    player.evaluate("Playback.camera.constructor.TURN = Infinity")
    player.emulate_media(reduced_motion="no-preference")
    player.keyboard.press("2")
    assert player.evaluate("Boolean(Playback.camera.turning)"), "it turns"
    player.emulate_media(reduced_motion="reduce")
    player.evaluate(f"Playback.camera.constructor.TURN = {takes}")
    assert pressed(player) == "top"
    above = looked_from()
    assert above[1] > 2 * abs(above[0])
    player.keyboard.press("3")
    front = looked_from()
    assert front[2] > 3 * abs(front[1])
    player.click("#overview")
    assert looked_from() == pytest.approx(overview, abs=1e-4)
    player.mouse.move(350, 300)
    player.mouse.down()
    player.mouse.move(420, 330)
    player.mouse.up()
    until(lambda: pressed(player) is None, "it is no overview any more")


def test_a_drone_is_followed(player: Page) -> None:
    player.select_option("#drone", "2")
    assert pressed(player) == "follow"
    until(lambda: player.evaluate("!Playback.camera.turning"), "it turns for ever")
    player.evaluate("Playback.player.seek(2)")
    off = "Playback.viewer.controls.target.distanceTo(Playback.drones[2].getWorldPosition(new MeshCat.THREE.Vector3()))"
    until(lambda: player.evaluate(off) < 1e-6, "it is not followed")
    player.keyboard.press("4")
    assert player.input_value("#drone") == "3"
    player.keyboard.press("1")
    assert pressed(player) == "overview"


def test_a_click_chooses_a_drone(player: Page) -> None:
    spot = player.evaluate(
        "(() => { const at = Playback.drones[3].getWorldPosition(new MeshCat.THREE.Vector3());"
        " at.project(Playback.viewer.camera);"
        " return [(at.x + 1) / 2 * innerWidth, (1 - at.y) / 2 * innerHeight]; })()"
    )
    player.mouse.click(*spot)
    assert (pressed(player), player.input_value("#drone")) == ("follow", "3")


def test_trails_grow_and_can_be_left_out(player: Page) -> None:
    def painted() -> int:
        """How many pixels are blue, or violet: drones of the first rows, and their trails."""
        scene = picture(player)
        return int(((scene[..., 2] - scene[..., 0]) > 60).sum())

    player.evaluate("Playback.player.seek(2.9)")
    whole = painted()
    player.keyboard.press("t")
    assert player.input_value("#trail") == "3"
    assert player.evaluate("Playback.trails.uniforms.lasting.value") == 3
    player.keyboard.press("t")
    assert player.input_value("#trail") == "none"
    assert painted() < whole - 50
    player.keyboard.press("t")
    assert abs(painted() - whole) < 20


def test_trails_of_curves_are_close_to_the_motion(player: Page) -> None:
    """At the time of each key, with few pieces; the drone changes its colour at 0.5 s."""
    pieces = player.evaluate("""(() => {
      const times = [...Array(101).keys()].map((key) => key / 100);
      const positions = times.flatMap((time) => [3 * Math.cos(time), 3 * Math.sin(time * time), time]);
      return Playback.trails.constructor.pieces(times, positions, [[0.5, "fallen", "#ff0000"]], "#0000ff");
    })()""")
    assert 4 < len(pieces) < 30
    assert [piece["tint"][0] for piece in pieces] == [float(piece["span"][0] >= 0.5) for piece in pieces]
    for time in np.arange(101) / 100:
        piece = next(one for one in pieces if one["span"][0] - 1e-9 <= time <= one["span"][1] + 1e-9)
        begin, end = np.array(piece["begin"]), np.array(piece["end"])
        place = begin + (time - piece["span"][0]) / (piece["span"][1] - piece["span"][0]) * (end - begin)
        assert np.linalg.norm(place - [3 * np.cos(time), 3 * np.sin(time**2), time]) < 0.0101


def test_a_still_picture_without_a_graphics_card_is_antialiased(player: Page) -> None:
    usual = player.evaluate("Playback.picture.constructor.STILL")
    shown = []
    for still in (1e9, 0):
        player.evaluate(f"Playback.picture.constructor.STILL = {still}; Playback.viewer.set_dirty()")
        shown.append(picture(player))
    player.evaluate(f"Playback.picture.constructor.STILL = {usual}")
    moving, still = (len(np.unique(one.reshape(-1, 3), axis=0)) for one in shown)
    assert still > 1.2 * moving
    assert 0.001 < (np.abs(shown[0] - shown[1]).max(axis=2) > 20).mean() < 0.1


def test_hostile_names_stay_text(player: Page) -> None:
    assert player.title().startswith(HOSTILE)
    assert player.locator("img").count() == 0
    assert player.inner_text("h1").startswith(HOSTILE)


def test_all_can_be_named_and_read(player: Page) -> None:
    assert player.evaluate(NAMELESS) == []
    assert player.evaluate(CONTRAST) == []


def test_its_keys_are_a_key_away(player: Page) -> None:
    keys = player.locator("#keys dl")
    assert keys.is_hidden()
    player.keyboard.press("?")
    assert keys.is_visible()
    player.keyboard.press("Escape")
    assert keys.is_hidden()
    player.click("#keys summary")
    assert keys.is_visible()
    player.mouse.click(350, 250)
    assert keys.is_hidden()


def test_space_plays_after_a_click_on_a_button(player: Page) -> None:
    run_at(player, SLOW)
    player.click("#top")
    player.keyboard.press(" ")
    until(lambda: player.evaluate("Playback.player.playing"), "it does not play")
    player.keyboard.press(" ")
    assert not player.evaluate("Playback.player.playing")
