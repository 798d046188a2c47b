"""A team of lamps, and programs that play robots of it."""

from __future__ import annotations

import sys
from itertools import pairwise

import robochoc
from robochoc.model.problem import Team

_BEGIN = """
import json, os, signal, sys, time
for line in sys.stdin:
    seen = json.loads(line)
    if seen["type"] == "welcome":
        values = [one["value"] for one in seen["values"]]
        neighbours = [one["robot"] for one in seen["neighbours"]]
        costs_of_own = [one["cost"] for one in seen["values"]]
        robot = seen["robot"]
        continue
    if seen["type"] == "end":
        break
    number = seen["round"]
    costs = [(one["violations"], one["cost"]) for one in seen["costs"]]
    best = costs.index(min(costs))
    move = {"type": "move", "round": number, "value": values[best]}
"""
_SEND = """
    print(json.dumps(move), flush=True)
"""


def program(body: str = "", *, sends: bool = True) -> list[str]:
    """Return the command of a program that plays the best answer, changed by `body`, and sends its move.

    In `body`: `seen` (the line), `number` (the round), `values`, `neighbours`, `costs`, `best` and `move`.
    """
    lines = "".join(f"    {line}\n" for line in body.splitlines())
    return [sys.executable, "-I", "-c", _BEGIN + lines + (_SEND if sends else "")]


def lamps(count: int = 4) -> Team:
    """Return lamps in a row: neighbours with the same colour cost 4, colours cost their number. The optimum is 2."""
    model = robochoc.Model("lamps")
    colours = [model.robot(f"r{number}").variable("c", range(3)) for number in range(count)]
    model.minimize(sum((one == other) * 4 for one, other in pairwise(colours)) + sum(colours))
    return model.team
