"""Names of files that are handed on."""

from __future__ import annotations

from robochoc.app.flights.names import file_name
from tests.support.cases import looped


@looped(
    ("name", "expected"),
    [
        ("Cube", "Cube.zip"),
        ("../../etc/passwd", "etc-passwd.zip"),
        ('a"; filename="b.exe', "a-filename-b-exe.zip"),
        ("a\r\nSet-Cookie: x", "a-Set-Cookie-x.zip"),
        ("", "team.zip"),
        ("...", "team.zip"),
        ("NUL", "team.zip"),
        ("com1", "team.zip"),
        ("дрон", "team.zip"),
        ("x" * 500, "x" * 60 + ".zip"),
    ],
)
def test_whatever_a_team_is_called_its_file_has_a_plain_name(name: str, expected: str) -> None:
    assert file_name(name, ".zip") == expected
