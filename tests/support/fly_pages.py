"""The page "Fly" of the application, for tests of it: teams that have decided, and the page in a browser."""

from __future__ import annotations

from robochoc.app.jobs.job import end_all
from robochoc.app.runs.options import RunOptions
from robochoc.app.runs.run import Run, RunState
from robochoc.app.runs.runs import Runs
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.store import TeamStore
from tests.support.limits import wait_until

READY = ".stage[data-ready=true]"
LINE = ".stage-line input"
FLIGHT = "document.querySelector('.stage-views iframe').contentWindow.Playback.player"
TALK = "document.querySelector('.stage-views figure:last-child iframe').contentWindow.Sniffer.page"


class DecidedTeam:
    """A team in the store, as `Runs` wants it."""

    def __init__(self, teams: TeamStore, sketch: Sketch) -> None:
        self.sketch = sketch
        self.id = teams.add(sketch)
        self.folder = teams.path(self.id)


def decided(teams: TeamStore, sketch: Sketch) -> tuple[DecidedTeam, Run]:
    """Return a team that has decided."""
    team = DecidedTeam(teams, sketch)
    run = Runs(team).start(RunOptions(protocol="syncbb"))
    wait_until(lambda: run.state is not RunState.RUNNING, lambda: run.message)
    end_all()
    assert run.state is RunState.ENDED, run.message
    return team, run
