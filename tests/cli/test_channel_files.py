"""Channel models of one's own: TOML files, what is wrong with them, and the command line."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import msgspec
import pytest

from robochoc.communication.simulator.channel import CHANNELS, LARGEST_FILE, ChannelModel, read_channel
from robochoc.communication.simulator.loss_models import Bursts, NamedLink, PathLoss
from robochoc.formats import InvalidInputError
from tests.support.cases import cases
from tests.support.journal_entries import entries_of
from tests.support.program import ROOT, robochoc_within

BY_LINK = """
[path_loss]
power_dbm = 15
sensitivity_dbm = -85
exponent = 3
shadowing_db = 6

[positions]
Base = [0, 0]
Roof = [1.5, 2, 3]

[bursts]
begin = 0.02
end = 0.3
loss = 0.8

[[links]]
between = ["Base", "Roof"]
loss = 0

[[links]]
between = ["Roof", "A"]
loss = 1
one_way = true
"""


def test_a_file_has_all_fields(tmp_path: Path) -> None:
    fields = {**msgspec.structs.asdict(CHANNELS["wpan"]), "name": "mesh"}
    plain = {field: value for field, value in fields.items() if isinstance(value, str | int | float)}
    path = tmp_path / "any.toml"
    path.write_text("".join(f"{field} = {json.dumps(value)}\n" for field, value in plain.items()) + BY_LINK)
    read = read_channel(path)
    assert read == ChannelModel(
        **plain,  # type: ignore[arg-type]
        path_loss=PathLoss(power_dbm=15, sensitivity_dbm=-85, exponent=3, shadowing_db=6),
        positions={"Base": (0, 0), "Roof": (1.5, 2, 3)},
        bursts=Bursts(begin=0.02, end=0.3, loss=0.8),
        links=(NamedLink(between=("Base", "Roof"), loss=0), NamedLink(between=("Roof", "A"), loss=1, one_way=True)),
    )
    assert {*plain, "path_loss", "distance_loss", "positions", "bursts", "links"} == {*ChannelModel.__struct_fields__}


def test_the_example_in_the_manual_is_a_channel(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "guides" / "channels.md").read_text()
    for name in ("mesh", "valley"):
        path = tmp_path / f"{name}.toml"
        path.write_text(text.split(f'```toml title="{name}.toml"\n')[1].split("```")[0])
        assert read_channel(path).name == name
    kinds = (ChannelModel, PathLoss, Bursts, NamedLink)
    assert all(f"`{field}`" in text for kind in kinds for field in kind.__struct_fields__)


def test_a_file_needs_a_latency_only(tmp_path: Path) -> None:
    path = tmp_path / "still.toml"
    path.write_text("latency_ms = 5")
    assert read_channel(path) == ChannelModel(name="still", latency_ms=5)


BAD = {
    "": "the field 'latency_ms' is missing",
    "latency_ms": "is not a valid TOML file",
    "latency_ms = 1\nlatency_ms = 2": "is not a valid TOML file",
    "latency_ms = 5\nlos = 0.1": "there is no field 'los'; did you mean 'loss'?",
    "latency_ms = -1": "latency_ms: expected a number from 0 to 60,000, got -1",
    "latency_ms = nan": "latency_ms: expected a number from 0 to 60,000, got nan",
    "latency_ms = inf": "latency_ms: expected a number from 0 to 60,000, got inf",
    "latency_ms = 1e9": "latency_ms: expected",
    "latency_ms = 'five'": "latency_ms: expected a number, found a text",
    "latency_ms = 5\nminimum_ms = 6": "minimum_ms: expected at most latency_ms",
    "latency_ms = 5\nloss = 1": "loss: expected a number from 0 to 0.9, got 1",
    "latency_ms = 5\nloss = nan": "loss: expected",
    "latency_ms = 5\nbandwidth_bps = 0": "bandwidth_bps: expected a number from 1 to",
    "latency_ms = 5\nbandwidth_bps = inf": "bandwidth_bps: expected",
    "latency_ms = 5\npayload_bytes = 0": "payload_bytes: expected a number from 8 to 65,535",
    "latency_ms = 5\npayload_bytes = 10.5": "payload_bytes: expected an integer, found a number",
    "latency_ms = 5\nshared = 1": "shared: expected true or false, found an integer",
    "latency_ms = 5\ntimeout_ms = 500\nlongest_timeout_ms = 400": "longest_timeout_ms: expected at least timeout_ms",
    "latency_ms = 5\ncheck_ns = 1000000000000000000000000": "check_ns: ",
    "latency_ms = 5\nmessage_loss = 0.95": "message_loss: ",
    f"latency_ms = 1{'0' * 400}": "latency_ms: ",
    f"latency_ms = 1{'0' * 5000}": "is not a valid TOML file",
    f"latency_ms = {'[' * 20000}": "is not a valid TOML file",
    "latency_ms = 5\nname = 'a b'": "name: expected up to 40",
    "latency_ms = 5\nname = 'wlan'": "name: wlan is the name of a shipped model",
    "latency_ms = 5\nname = ['wlan']": "name: expected a text, found a list",
    "[channel]\nlatency_ms = 5": "there is no field 'channel'",
    f"#{'x' * LARGEST_FILE}": "is too large",
    "latency_ms = 5\npath_loss = 3": "path_loss: expected an object or null, found an integer",
    "latency_ms = 5\n[path_loss]\npower_dbm = 10": "path_loss: the field 'sensitivity_dbm' is missing",
    "latency_ms = 5\n[path_loss]\npower_dbm = 10\nsensitivity_dbm = -80\nexponent = 0": (
        "path_loss: exponent: expected a number from 1 to 10, got 0"
    ),
    "latency_ms = 5\n[path_loss]\npower_dbm = nan\nsensitivity_dbm = -80": "path_loss: power_dbm: expected a number",
    "latency_ms = 5\n[path_loss]\npower_dbm = 1\nsensitivity_dbm = -80\npower = 3": (
        "path_loss: there is no field 'power'; did you mean 'power_dbm'?"
    ),
    "latency_ms = 5\ndistance_loss = [[0, 0.1], [0, 0.2]]": "distance_loss: expected growing distances, got 0 after 0",
    "latency_ms = 5\ndistance_loss = [[0, 1.1]]": "distance_loss: expected a number from 0 to 1, got 1.1",
    "latency_ms = 5\ndistance_loss = [[-1, 1]]": "distance_loss: expected a number from 0 to 1,000,000,000, got -1",
    "latency_ms = 5\ndistance_loss = [[inf, 1]]": "distance_loss: expected a number",
    "latency_ms = 5\ndistance_loss = [[1, 0.5, 2]]": "distance_loss[0]: expected a list of length 2",
    "latency_ms = 5\ndistance_loss = [0, 1]": "distance_loss[0]: expected a list, found an integer",
    f"latency_ms = 5\ndistance_loss = [{','.join(f'[{place}, 0]' for place in range(1001))}]": "up to 1,000 pairs",
    "latency_ms = 5\ndistance_loss = [[1, 0.5]]\n[path_loss]\npower_dbm = 1\nsensitivity_dbm = -80": (
        "distance_loss: cannot be combined with path_loss"
    ),
    "latency_ms = 5\nunit_m = 0": "unit_m: expected a number from 0.001 to",
    "latency_ms = 5\n[positions]\nA = [0, 0]": "positions: requires path_loss or distance_loss; add one",
    "latency_ms = 5\ndistance_loss = [[1, 0.5]]\n[positions]\nA = [0]": "positions: A: expected [x, y] or [x, y, z]",
    "latency_ms = 5\ndistance_loss = [[1, 0.5]]\n[positions]\nA = [0, nan]": "positions: A: expected [x, y]",
    "latency_ms = 5\ndistance_loss = [[1, 0.5]]\n[positions]\nA = [0, 1e10]": "positions: A: expected [x, y]",
    "latency_ms = 5\ndistance_loss = [[1, 0.5]]\n[positions]\nA = 'here'": "expected a list, found a text",
    f"latency_ms = 5\ndistance_loss = [[1, 0.5]]\n[positions]\n'{'A' * 500}' = [1]": "positions: AAA",
    "latency_ms = 5\n[bursts]\nbegin = 0.1\nend = 0\nloss = 1": "bursts: end: expected a number from 0.001 to 1, got 0",
    "latency_ms = 5\n[bursts]\nbegin = 0.1\nend = 0.5": "bursts: the field 'loss' is missing",
    "latency_ms = 5\n[[links]]\nbetween = ['A', 'A']\nloss = 1": "links[0]: between: expected two robots, got A twice",
    "latency_ms = 5\n[[links]]\nbetween = ['A']\nloss = 1": "links[0].between: expected a list of length 2",
    "latency_ms = 5\n[[links]]\nbetween = ['A', 'B']\nloss = -1": "links[0]: loss: expected a number from 0 to 1",
    "latency_ms = 5\n[links]\nA = 0.5": "links: expected a list, found an object",
}


def test_a_bad_file_is_told_in_one_line(tmp_path: Path) -> None:
    with cases() as each:
        for content, message in BAD.items():
            with each(content[:60]):
                path = tmp_path / "bad.toml"
                path.write_text(content)
                with pytest.raises(InvalidInputError) as caught:
                    read_channel(path)
                (line,) = str(caught.value).splitlines()
                assert re.match(rf"{re.escape(str(path))}(?::\d+)?: ", line)
                assert message in line
                assert len(line) < 400 + len(str(path))


def test_what_is_no_file_or_no_text(tmp_path: Path) -> None:
    (tmp_path / "raw.toml").write_bytes(b"\xff\xfe")
    for name, message in (("", "is not a file"), ("none.toml", "is not a file"), ("raw.toml", "is not UTF-8")):
        with pytest.raises(InvalidInputError, match=message):
            read_channel(tmp_path / name)


def test_what_cannot_be_is_refused_in_python_too() -> None:
    for values in [{"loss": 1.0}, {"latency_ms": -1.0}, {"sigma": math.nan}]:
        with pytest.raises(ValueError, match=f"{next(iter(values))}: expected"):
            msgspec.structs.replace(CHANNELS["wlan"], **values)


# The command line


def test_the_command_line_simulates_seconds(tmp_path: Path) -> None:
    run = ("solve", ROOT / "instances" / "queens3d-4", "--runtime", "simulator", "--channel")
    words = robochoc_within(*run, "wwan", "--journal", tmp_path / "journal.jsonl")
    assert words.returncode == 0
    assert words.stdout.rstrip().endswith("simulated (wwan)")
    assert entries_of(tmp_path / "journal.jsonl")[0]["channel"] == "wwan"
    (tmp_path / "own.toml").write_text("latency_ms = 1000")
    outcome = json.loads(robochoc_within(*run, tmp_path / "own.toml", "--json").stdout)
    assert outcome["channel"] == "own"
    assert outcome["metrics"]["simulated_s"] > 1


def test_what_is_lost_depends_on_where_robots_are(tmp_path: Path) -> None:
    radio = tmp_path / "radio.toml"
    run = ("solve", ROOT / "docs" / "examples" / "scouts", "--runtime", "simulator", "--protocol", "dsa", "--json")
    radio.write_text("latency_ms = 1\ndistance_loss = [[0, 0], [10, 1]]\n[positions]\nBase = [50, 0]\n")
    outcome = json.loads(robochoc_within(*run, "--channel", radio).stdout)
    assert 0 < outcome["metrics"]["lost_messages"] <= outcome["metrics"]["messages"]
    radio.write_text(radio.read_text().replace("Base", "Bose"))
    refused = robochoc_within(*run, "--channel", radio)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "--channel radio: positions: there is no robot Bose (did you mean 'Base'?)" in refused.stderr


def test_a_channel_that_is_no_file_of_a_channel_is_told() -> None:
    for path, message in ((ROOT / "README.md", "is not a valid TOML file"), (ROOT, "is not a file")):
        words = ("--runtime", "simulator", "--channel", path)
        done = robochoc_within("solve", ROOT / "docs" / "examples" / "scouts", *words)
        assert (done.returncode, done.stdout) == (1, "")
        assert message in done.stderr


def test_an_unknown_field_has_its_line_and_the_nearest_name(tmp_path: Path) -> None:
    for text, line in [
        ("latency_ms = 5\n\nlos = 0.1\n", 3),
        ("latency_ms = 5\nbursts = { begin = 0.1, end = 0.5, los = 1 }\n", 2),
        ("latency_ms = 5\n[bursts]\nbegin = 0.1\nend = 0.5\nlos = 1\n", 5),
        ('latency_ms = 5\n[[links]]\nbetween = ["A", "B"]\nloss = 1\n[[links]]\nlos = 1\nbetween = ["A", "C"]\n', 6),
    ]:
        path = tmp_path / "bad.toml"
        path.write_text(text)
        with pytest.raises(InvalidInputError, match=rf"bad.toml:{line}: .*no field 'los'; did you mean 'loss'"):
            read_channel(path)
