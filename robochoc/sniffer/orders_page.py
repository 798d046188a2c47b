"""A page on which one chooses the next message that arrives, and goes back: the state graph of a small team.

The page is one file with all its data: the states of the robots, the messages, and the steps between the states of the
team, up to a number of states. It shows all steps, also those that an exploration skips because they commute.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from typing import Any

import msgspec

from robochoc.exploration.check import CheckedTeam, CheckOptions, graph_of
from robochoc.exploration.judgement import values_text
from robochoc.exploration.state_texts import StateTexts
from robochoc.exploration.team_state import LOST, Delivery, TeamState
from robochoc.replay.inspection import Inspector
from robochoc.replay.robot_states import inspected
from robochoc.sniffer.page import base_style
from robochoc.system.plain_text import counted, printable
from robochoc.view.page_scripts import content_security_policy

MOST_STATES = 10_000
"""The maximum number of states on a page, which then has a few megabytes."""
_LEFT_OUT = -1
"""The number of a state that is not on the page."""
_TITLE = "<title>Orders</title>"


def orders_page(checked: CheckedTeam, options: CheckOptions, most: int = MOST_STATES) -> bytes:
    """Return the page in UTF-8. It begins with the run that leads to the fault of `checked`, if it has one.

    Args:
        checked: The team.
        options: The options of the check.
        most: The maximum number of states on the page, besides those that lead to the fault.

    Raises:
        UnsupportedError: with the compiled core.
    """
    content = _Content(checked, options, most).as_dict()
    title = f"{options.run.protocol}: {checked.team.name}"
    data = msgspec.json.encode(content).decode().replace("<", "\\u003c")
    script = _asset("orders.js")
    head = (
        f'<meta http-equiv="Content-Security-Policy" content="{content_security_policy([script])}">\n'
        f'<link rel="icon" href="data:,">\n<style>\n{base_style()}{_asset("orders.css")}</style>\n</head>'
    )
    body = f'<script id="data" type="application/json">{data}</script>\n<script>{script}</script>\n</body>'
    page = _asset("orders.html").replace(_TITLE, f"<title>{escape(printable(title))}</title>")
    return page.replace("</head>", head).replace("</body>", body).encode()


class _Content:
    """Collects the data of the page."""

    def __init__(self, checked: CheckedTeam, options: CheckOptions, most: int) -> None:
        self._checked, self._options, self._most = checked, options, most
        self._graph = graph_of(checked.case, options)
        self._texts = StateTexts(self._graph)
        self._numbers: dict[TeamState, int] = {}
        self._states: list[dict[str, Any]] = []
        self._messages: dict[str, int] = {}
        self._message_numbers: dict[tuple[int, int, int, int], int] = {}
        self._robots: dict[tuple[int, int, int], int] = {}
        self._robot_states: list[dict[str, Any]] = []
        self._inspectors: dict[int, list[Inspector]] = {}

    def as_dict(self) -> dict[str, Any]:
        """Return the data of the page."""
        found, team = self._checked.exploration, self._checked.team
        path = self._path(found.run)
        is_complete = self._add_states()
        number = f"{counted(len(self._numbers), 'state')}{'' if is_complete else ', not all states of the team'}"
        return {
            "title": f"{self._options.run.protocol} on {team.name}",
            "facts": f"{counted(len(team.robots), 'robot')}, {number}",
            "complete": is_complete,
            "fault": found.explanation.text or found.fault,
            "robots": self._robot_states,
            "messages": list(self._messages),
            "states": self._states,
            "path": path,
        }

    def _path(self, steps: Sequence[Delivery]) -> list[int]:
        """Number the states on a path, or only the first one. Return the places of its steps among all steps."""
        path = []
        states = self._graph.along(steps)
        for state in states:
            self._numbers.setdefault(state, len(self._numbers))
        for state, step in zip(states, steps, strict=False):
            path.append([move.delivery for move in self._graph.moves(state)].index(step))
        return path

    def _add_states(self) -> bool:
        """Add all states, breadth first from those that have a number. Return whether none is left out."""
        waiting, most = deque(self._numbers), max(self._most, len(self._numbers))
        is_complete = True
        refusals: list[tuple[dict[str, Any], TeamState, str]] = []
        while waiting:
            state = waiting.popleft()
            fault, answer = self._end(state)
            steps: list[dict[str, Any]] = []
            for move in () if fault else self._graph.moves(state):
                step = self._step(state, move.delivery)
                after = self._numbers.get(move.state)
                if move.refusal:
                    after = None
                    refusals.append((step, state, move.refusal))
                elif after is None and len(self._numbers) < most:
                    after = self._numbers[move.state] = len(self._numbers)
                    waiting.append(move.state)
                elif after is None:
                    is_complete = False
                step["after"] = _LEFT_OUT if after is None else after
                steps.append(step)
            self._states.append(self._state(state, fault, answer, steps))
        for step, state, refusal in refusals:  # the graph has no states after them
            step["after"] = len(self._states)
            self._states.append(self._state(state, refusal, "", []))
        return is_complete

    def _end(self, state: TeamState) -> tuple[str, str]:
        """Return the fault in a state, and the answer if the search is over without a fault; otherwise empty texts."""
        graph = self._graph
        fault = graph.fault_on_the_way(state)
        if fault or not graph.is_end(state):
            return fault, ""
        fault = graph.fault_at_the_end(state)
        return fault, "" if fault else graph.stage_of(state).judge.answer_in_words(
            graph.robots_in(state), graph.witness(state)
        )

    def _state(self, state: TeamState, fault: str, answer: str, steps: list[dict[str, Any]]) -> dict[str, Any]:
        stage = self._graph.stage_of(state)
        queues = []
        for (receiver, sender), queue in state.queues:
            waiting = [self._message(state, receiver, sender, number) for number in queue]
            queues.append({"to": stage.names[receiver], "from": stage.names[sender], "messages": waiting})
        return {
            "robots": [self._robot(state, place) for place in range(len(stage.names))],
            "queues": queues,
            "steps": steps,
            "fault": fault,
            "answer": answer,
            "right": stage.judge.right_answer,
        }

    def _step(self, state: TeamState, delivery: Delivery) -> dict[str, Any]:
        """Return a step; `single`: it delivers, or loses, the first message of one channel."""
        text = self._texts.step(state, delivery)
        single = delivery.senders[0] if len(delivery.senders) == 1 else ""
        return {"text": text, "to": delivery.receiver, "from": single, "lost": delivery.lost}

    def _message(self, state: TeamState, receiver: int, sender: int, number: int) -> int:
        """Return the place of a message's text; -1 if the message is lost."""
        if number == LOST:
            return -1
        key = state.stage, receiver, sender, number
        if key not in self._message_numbers:
            text = self._texts.message(state, receiver, sender, number)
            self._message_numbers[key] = self._messages.setdefault(text, len(self._messages))
        return self._message_numbers[key]

    def _robot(self, state: TeamState, place: int) -> int:
        """Return the place of a robot's state among the states of all robots."""
        key = state.stage, place, state.robots[place]
        if key not in self._robots:
            self._robots[key] = len(self._robots)
            self._robot_states.append(self._robot_state(*key))
        return self._robots[key]

    def _robot_state(self, stage_number: int, place: int, number: int) -> dict[str, Any]:
        stage = self._graph.stage_of(TeamState((), (), stage=stage_number))
        if stage_number not in self._inspectors:
            self._inspectors[stage_number] = [Inspector(stage.parts[name]) for name in stage.names]
        protocol = stage.robots[place].hosts[number].protocol
        shown = inspected(self._inspectors[stage_number][place], protocol)
        return {
            "name": stage.names[place],
            "value": values_text(stage.judge.team, shown.value) or "no value",
            "view": shown.view,
            "domain": [(one.value, one.ruled_out_by) for one in shown.domain],
            "nogoods": shown.nogoods,
            "more": shown.more,
        }


def _asset(name: str) -> str:
    return (files(__package__) / "orders" / name).read_text(encoding="utf-8")
