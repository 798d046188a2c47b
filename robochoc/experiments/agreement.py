"""Compares all answers to one problem: contradictory proofs are a fault of the program."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from decimal import Decimal
from typing import Any

from robochoc.communication.simulator.channel import CHANNELS
from robochoc.experiments.task import Row, Status, Task
from robochoc.model.outcome import Verdict
from robochoc.run.defaults import AUTO, CENTRAL
from robochoc.run.registry import protocol_named
from robochoc.system.errors import RobochocError

_OWN = "PROBLEM"
"""The folder for generated problems."""
_Question = tuple[str, str | None, str | None]


class DisagreementError(RobochocError):
    """Two answers contradict each other, or the checker found one wrong. The text has the commands to repeat them."""


class Agreement:
    """The answers found so far, by problem, withdrawal rule and objectives."""

    def __init__(self) -> None:
        self._answers: dict[_Question, list[tuple[Task, Row]]] = {}

    def add(self, task: Task, row: Row) -> None:
        """Compare the answer of a run with the other answers to its problem.

        Raises:
            DisagreementError: if the answers contradict each other, or the checker found this answer wrong.
        """
        if row.status == Status.REFUTED:
            raise DisagreementError(
                f"the checker refutes the answer of {task.setup.label}: {row.reason}\n{repeat_commands(task)}"
            )
        if row.status != Status.DONE or "after" in task.problem.scenario:
            return
        others = self._answers.setdefault((row.digest, task.setup.withdraw, task.setup.objectives), [])
        for other_task, other in others:
            if why := contradiction(row, other):
                text = f"{task.setup.label} and {other_task.setup.label} contradict each other on {row.team}: {why}"
                raise DisagreementError(f"{text}\n{repeat_commands(task)}\n{repeat_commands(other_task)}")
        kinds = {(one.verdict, one.cost) for _, one in others}
        if (row.verdict, row.cost) not in kinds:
            others.append((task, row))


def contradiction(one: Row, other: Row) -> str:
    """Return why two answers to the same problem contradict each other, or an empty text if they agree."""
    verdicts = {one.verdict, other.verdict}
    if Verdict.NO_SOLUTION in verdicts and len(verdicts) > 1:
        return f"{one.verdict} and {other.verdict}"
    if Verdict.OPTIMAL not in verdicts:
        return ""
    optimum, found = (one, other) if one.verdict == Verdict.OPTIMAL else (other, one)
    if optimum.withdrawn != found.withdrawn and found.verdict == Verdict.OPTIMAL:
        return f"at least {optimum.withdrawn} and at least {found.withdrawn} robots withdraw"
    if optimum.cost is None or found.cost is None or optimum.withdrawn != found.withdrawn:
        return ""
    best, cost = Decimal(optimum.cost), Decimal(found.cost)
    better = cost > best if optimum.maximises else cost < best
    if better or (found.verdict == Verdict.OPTIMAL and cost != best):
        return f"{optimum.cost} was reported as optimal, but {found.cost} was found"
    return ""


def repeat_commands(task: Task) -> str:
    """Return the commands that repeat a single run."""
    problem, setup = task.problem, task.setup
    made = [_generated(problem.family, problem.parameters)] if problem.family else []
    folder = problem.path or _OWN
    if problem.scenario:  # written into another folder, so that the user's files do not change
        scenario = _options(["robochoc", "generate", "scenario", folder], problem.scenario)
        made.append(f"{scenario} --force" if problem.family else scenario)
        folder = _OWN
    words = ["robochoc", "solve", folder, "--protocol", setup.protocol, "--runtime", setup.runtime]
    words += ["--seed", str(task.seed)] * bool(task.seed)
    words += ["--order", setup.order] if setup.order else []
    words += ["--channel", _channel(setup.channel.name)] if setup.channel else []
    words += ["--schedule", setup.schedule] if setup.schedule != "concurrent" else []
    words += ["--delay", str(setup.delay)] if setup.delay else []
    words += [f"--withdraw={setup.withdraw}"] if setup.withdraw else []
    words += ["--objectives", setup.objectives] if setup.objectives else []
    words += ["--preprocess", setup.preprocess] if setup.preprocess else []
    words += ["--answer", setup.answer] if setup.answer != "best" else []
    words += ["--cold"] * setup.cold
    words += ["--no-repair"] * (not setup.repair and _can_be_repaired(setup.protocol))
    words += ["--verify"] * setup.verify
    words += ["--owner", str(problem.parameters["owner"])] if problem.path and "owner" in problem.parameters else []
    words += [word for name, value in setup.settings.items() for word in ("--set", f"{name}={value}")]
    for name, value in _limits(task).items():
        words += [f"--{name}", f"{value:g}"]
    return " && ".join([*made, shlex.join(words)])


def _channel(name: str) -> str:
    return name if name in CHANNELS else f"{name}.toml"


def _limits(task: Task) -> dict[str, float]:
    """Return the limits of a run, and the cost that means infinity in a file of another tool."""
    limits, given = task.limits, task.problem.parameters if task.problem.path else {}
    found = {name: getattr(limits, name) for name in ("timeout", "messages", "ncccs", "cycles")}
    found["infinity"] = given.get("infinity")
    return {name: value for name, value in found.items() if value is not None}


def _generated(family: str, parameters: Mapping[str, Any]) -> str:
    return _options(["robochoc", "generate", family], parameters)


def _options(words: list[str], parameters: Mapping[str, Any]) -> str:
    for name, value in parameters.items():
        option = f"--{name.replace('_', '-')}"
        several = str(value).split() if name == "kinds" else [str(value)]
        if value is not False:
            words += [option] if value is True else [word for one in several for word in (option, one)]
    return shlex.join([*words, "-o", _OWN])


def _can_be_repaired(protocol: str) -> bool:
    """Return whether a repair may follow the protocol called `protocol`."""
    return protocol == AUTO or (protocol != CENTRAL and not protocol_named(protocol).traits.complete)
