"""The places of sinks that command robots through ROS 2: `nav2:FILE@dds:5`.

The file is optional for some sinks, and may have options: `crazyflies.yaml?speed=1@dds:5`. Without a middleware, the
robots are in the default domain of DDS.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple
from urllib.parse import parse_qsl

from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.robots.sink import SinkError

_FORM = re.compile(r"(?:(?P<file>[^@?]+\.ya?ml)(?:\?(?P<options>[^@]*))?)?@?(?P<middleware>.*)", re.DOTALL)
_OPTIONS_MAX = 20
_DDS = "dds"


class CommandPlace(NamedTuple):
    """A file, if there is one, its options, and the place of the middleware."""

    file: Path | None
    options: Mapping[str, str]
    middleware: str

    @classmethod
    def parse(cls, text: str) -> CommandPlace:
        """Parse a place. Raises `SinkError`.

        >>> CommandPlace.parse("crazyflies.yaml?speed=1@rosbridge://robots:9090")
        CommandPlace(file=PosixPath('crazyflies.yaml'), options={'speed': '1'}, middleware='rosbridge://robots:9090')
        >>> CommandPlace.parse("").middleware
        'dds'
        """
        found = _FORM.fullmatch(text)
        file, options, middleware = found.groups() if found else (None, None, text)
        before, at, _ = middleware.partition("@")
        if at and ":" not in before:
            problem = f"{shortened(before)!r} is not the name of a YAML file"
            raise SinkError(on_one_line(f"{problem}; expected FILE.yaml@MIDDLEWARE"))
        try:
            pairs = parse_qsl(
                options or "", keep_blank_values=True, strict_parsing=bool(options), max_num_fields=_OPTIONS_MAX
            )
        except ValueError:
            problem = f"the options {shortened(options or '')!r} cannot be read"
            raise SinkError(on_one_line(f"{problem}; expected OPTION=VALUE&OPTION=VALUE")) from None
        if len(dict(pairs)) < len(pairs):
            raise SinkError(
                on_one_line(f"the options {shortened(options or '')!r} have a duplicate; delete one of them")
            )
        return cls(Path(file) if file else None, dict(pairs), middleware or _DDS)

    def number(self, name: str, usual: float, least: float, most: float) -> float:
        """Return the option `name` as a number. Raises `SinkError`."""
        text = self.options.get(name)
        if text is None:
            return usual
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not least <= value <= most:
            raise SinkError(on_one_line(f"{name}={shortened(text)} is not valid; expected {least:g} to {most:,g}"))
        return value
