"""Who is let in: browsers of this machine that know the path, and no other page in them."""

from __future__ import annotations

import asyncio
from collections.abc import MutableMapping
from typing import Any

import pytest

from robochoc.app.guard import Guard

SECRET = "secret"  # noqa: S105 - of a test
HERE = b"127.0.0.1:8000"


async def _inside(scope: MutableMapping[str, Any], _receive: object, send: Any) -> None:  # noqa: ANN401 - ASGI's
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
    else:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"inside"})


def _asked(path: str, *, kind: str = "http", **headers: bytes) -> list[dict[str, Any]]:
    """What is answered to a request."""
    answers: list[dict[str, Any]] = []

    async def send(message: MutableMapping[str, Any]) -> None:
        answers.append(dict(message))

    async def receive() -> MutableMapping[str, Any]:
        return {"type": f"{kind}.request"}

    scope = {"type": kind, "path": path, "headers": [(name.encode(), value) for name, value in headers.items()]}
    asyncio.run(Guard(_inside, SECRET, 8000)(scope, receive, send))
    return answers


def test_a_browser_of_this_machine_with_the_path_is_served() -> None:
    first, body = _asked("/secret/", host=HERE, origin=b"http://" + HERE)
    assert (first["status"], body["body"]) == (200, b"inside")


@pytest.mark.parametrize("host", [b"evil.example:8000", b"127.0.0.1", b"127.0.0.1:8001", b"", b"secret"])
def test_another_name_of_this_machine_is_not_found(host: bytes) -> None:
    assert _asked("/secret/", host=host)[0]["status"] == 404


@pytest.mark.parametrize("path", ["/", "", "/secre/", "/secrets/", "/x/secret/", "//secret/", "/SECRET/", "/sécret/"])
def test_without_the_secret_path_nothing_is_found(path: str) -> None:
    assert _asked(path, host=HERE)[0]["status"] == 404


@pytest.mark.parametrize("origin", [b"https://evil.example", b"null", b"http://127.0.0.1:8001", b"https://" + HERE])
def test_a_page_of_another_site_is_refused(origin: bytes) -> None:
    assert _asked("/secret/", host=HERE, origin=origin)[0]["status"] == 403


@pytest.mark.parametrize(
    ("path", "headers"),
    [
        ("/secret/_nicegui_ws/", {"host": HERE, "origin": b"http://evil.example"}),
        ("/_nicegui_ws/", {"host": HERE}),
        ("/secret/_nicegui_ws/", {"host": b"evil.example"}),
    ],
)
def test_its_sockets_are_refused_as_well(path: str, headers: dict[str, bytes]) -> None:
    assert _asked(path, kind="websocket", **headers) == [{"type": "websocket.close", "code": 1008}]


def test_a_socket_of_its_own_page_is_accepted() -> None:
    assert _asked("/secret/ws", kind="websocket", host=HERE, origin=b"http://" + HERE) == [{"type": "websocket.accept"}]


def test_answers_may_not_be_kept_nor_framed_elsewhere() -> None:
    headers = dict(_asked("/secret/", host=HERE)[0]["headers"])
    assert headers[b"cache-control"] == b"no-store"
    assert headers[b"x-frame-options"] == b"SAMEORIGIN"
    assert headers[b"referrer-policy"] == b"no-referrer"
