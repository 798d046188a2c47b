"""Command lines of `robochoc solve --ros`, and what they have published."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from click.testing import CliRunner, Result

from robochoc.cli.group import cli
from robochoc.robots.connections import open_source
from tests.support.program import ROOT

HANGAR = ROOT / "docs" / "examples" / "hangar"
PATROL = ROOT / "docs" / "examples" / "patrol"
SCOUTS = ROOT / "docs" / "examples" / "scouts"
MET = ("--situation", "flight", "--obstacle", "3,1,3", "--fail", "Fin@7")
SIMULATED = ("--runtime", "simulator", "--protocol", "dynabt")
OPENINGS = ["the start", "port without 3", "-Fin"]


def ran(*words: object) -> Result:
    done = CliRunner().invoke(cli, [*map(str, words)], catch_exceptions=False)
    assert "Traceback" not in done.output
    return done


def solved(*words: object) -> Result:
    return ran("solve", *words, *SIMULATED)


def epochs(result: Result) -> list[tuple[str, str, dict[str, int]]]:
    told = json.loads(result.stdout)["epochs"]
    return [(epoch["opened_by"], epoch["verdict"], epoch["assignment"]) for epoch in told]


def published(path: Path, topic: str, kind: str = "geometry_msgs/PoseStamped") -> list[tuple[float, tuple[float, ...]]]:
    """When, and where to, in the recording at `path`."""
    with open_source(f"mcap:{path}") as source:
        source.listen({topic: kind})
        found: list[tuple[float, tuple[float, ...]]] = []
        while (heard := source.next(0)) is not None:
            at = heard.fields["pose"]["position"]
            assert heard.fields["header"]["stamp"] == heard.at_ns
            found.append((heard.at_ns / 1e9, (at["x"], at["y"], at["z"])))
    return found


def messages(path: Path) -> list[tuple[str, float, Any]]:
    """Return topic, second and content of each message in a recording, as the reference reader of MCAP finds them."""
    from mcap.reader import make_reader  # noqa: PLC0415 - heavy
    from mcap_ros2.decoder import DecoderFactory  # noqa: PLC0415 - heavy

    with path.open("rb") as stream:
        read = make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        return [(channel.topic, message.log_time / 1e9, decoded) for _, channel, message, decoded in read]
