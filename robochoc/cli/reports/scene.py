"""The 3D scene for `robochoc solve`, `fly` and `animate`, as a file or live; and the page of a Pareto front."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.formats import write_atomically

if TYPE_CHECKING:
    from robochoc.flight.log import FlightLog
    from robochoc.flight.mission import Mission
    from robochoc.maps.ground_map import GroundMap
    from robochoc.model.outcome import Outcome
    from robochoc.model.problem import Team
    from robochoc.view.scene import Scene


def scene_for(
    outcome: Outcome,
    team: Team | None,
    *,
    mission: Mission | None = None,
    flown: FlightLog | None = None,
    ground: GroundMap | None = None,
) -> Scene:
    """Return the scene of `outcome`. Without the log of a flight, a flight in calm air is simulated.

    Args:
        outcome: The outcome.
        team: The team in the files, before its scenario. None: the scene shows only names.
        mission: The mission of `outcome`, if it is already known.
        flown: The log of a flight of `mission`.
        ground: A map of the ground, which is used if `mission` is None.
    """
    from robochoc.cli.reports.progress import stages
    from robochoc.flight.mission import mission_of
    from robochoc.flight.preview import preview_of
    from robochoc.view.scene import scene_of

    mission = mission or mission_of(outcome, team, ground=ground)
    weighted = None if team is None else any(robot.weight != 1 for robot in team.robots)
    if flown is not None:
        return scene_of(outcome, mission, flown, weighted=weighted)
    with stages(outcome.team) as progress:
        preview = preview_of(mission, progress)
    return scene_of(
        outcome, mission, preview.flown, flown_mission=preview.mission, why_not=preview.why_not, weighted=weighted
    )


def write_front(outcome: Outcome, team: Team, path: Path, *, quiet: bool) -> None:
    """Write the page on which a point of a Pareto front is chosen."""
    from robochoc.view.front_page import front_page

    write_atomically(path, front_page(outcome, team).encode())
    if not quiet:
        click.echo(f"{path}: choose a point of the front in a browser", err=True)


def show_scene(scene: Scene, path: Path | None, *, serve: bool, port: int = 0, quiet: bool = False) -> None:
    """Write `scene` as a page to `path`, if given, and then show it live if `serve` is set."""
    if path:
        _write_page(scene, path, quiet=quiet)
    if serve:
        _serve(scene, port)


def _write_page(scene: Scene, path: Path, *, quiet: bool) -> None:
    """Write `scene` as one self-contained page, and print its size and the next step."""
    from robochoc.view.page import scene_page

    content = scene_page(scene)
    write_atomically(path, content)
    if not quiet:
        click.echo(f"{path}: {len(content) / 1e6:.1f} MB; open it in a browser", err=True)


def _serve(scene: Scene, port: int) -> None:
    """Show `scene` in a browser on this machine until Ctrl-C."""
    from robochoc.view.live import serve_scene

    serve_scene(
        scene,
        port=port,
        ready=lambda url: click.echo(f"{url} shows the scene on this machine; Ctrl-C ends it", err=True),
    )
