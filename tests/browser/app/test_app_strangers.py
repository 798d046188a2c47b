"""What strangers ask for: paths that lead out of what is served, and bodies without an end."""

from __future__ import annotations

from http.client import HTTPConnection, HTTPResponse

import pytest

from robochoc.app.sketch.sketch import Sketch
from robochoc.app.store import TeamStore
from tests.support.app_server import AppServer
from tests.support.limits import HANG_S

SECRET = "nobody may read this"  # noqa: S105 - of a test
UP = ("..", "%2e%2e", "..%2f..", "%2e%2e%2f%2e%2e", "..%5c..", "%252e%252e", "....//", "%00", "~")


def _asked(application: AppServer, path: str, method: str = "GET", **headers: str) -> tuple[HTTPResponse, bytes]:
    """What is answered to a request without a body, whatever its headers promise."""
    connection = HTTPConnection("127.0.0.1", application.port, timeout=HANG_S)
    try:
        connection.putrequest(method, f"{application.path}{path}", skip_host=True)
        for name, value in {"Host": f"127.0.0.1:{application.port}", **headers}.items():
            connection.putheader(name.replace("_", "-"), value)
        connection.endheaders()
        answer = connection.getresponse()
        return answer, answer.read()
    finally:
        connection.close()


@pytest.mark.parametrize(
    "route",
    ["{up}/secret.txt", "team/{team}/kept/{up}/secret.txt", "team/{team}/kept/00001/{up}%2fsecret.txt",
     "team/{up}/kept/00001/report.html", "team/{up}/study/report.html", "team/{up}/model", "lessons/{up}",
     "_nicegui/{up}/secret.txt", "team/{team}/kept/00001/history.json"],
)  # fmt: skip
def test_no_path_leads_out_of_what_is_served(application: AppServer, teams: TeamStore, route: str) -> None:
    team = teams.add(Sketch(story=SECRET))
    (teams.folder / "secret.txt").write_text(SECRET)
    (teams.path(team) / "secret.txt").write_text(SECRET)
    for up in UP:
        answer, body = _asked(application, route.format(up=up, team=team))
        assert answer.status in {200, 404, 405}, up
        assert SECRET.encode() not in body, up
        assert answer.getheader("X-Content-Type-Options") == "nosniff" or answer.status == 404, up


def test_a_gigabyte_is_refused_before_it_is_sent(application: AppServer) -> None:
    answer, _ = _asked(application, "_nicegui/client/x/upload/1", "POST", Content_Length=str(1 << 30))
    assert answer.status == 413
