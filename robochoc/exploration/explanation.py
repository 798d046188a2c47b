"""A fault in plain words: what is wrong, in which state, after which messages, and what is right."""

from __future__ import annotations

from collections.abc import Iterator

from robochoc.exploration.judgement import values_text
from robochoc.exploration.state_graph import StateGraph
from robochoc.exploration.state_texts import StateTexts
from robochoc.exploration.team_state import Explanation, Exploration, TeamState
from robochoc.system.plain_text import counted

LAST_STEPS = 3
"""The number of steps that the paragraph repeats."""


def explanation_of(found: Exploration, graph: StateGraph) -> Explanation:
    """Explain the fault that was found in `graph`."""
    states, texts = graph.along(found.run), StateTexts(graph)
    steps = tuple(texts.step(state, delivery) for state, delivery in zip(states, found.run, strict=False))
    sentences = [f"{found.fault[:1].upper()}{found.fault[1:]}."]
    if found.cycle:
        sentences.append(_about_the_cycle(len(found.path), len(steps)))
    elif states:
        sentences += _about_the_state(states[-1], graph, len(steps))
    if steps:
        last = steps[-LAST_STEPS:]
        sentences.append(f"{'The steps' if len(last) == len(steps) else 'The last steps'}: {'. '.join(last)}.")
    state = states[-1] if states else graph.start().state
    return Explanation(" ".join([*sentences, graph.stage_of(state).judge.right_answer]), steps)


def _about_the_cycle(before: int, steps: int) -> str:
    """Return a sentence about the steps that can be repeated. `before`: the number of steps before them."""
    first = f"the state after step {before}" if before else "the state at the start"
    one = steps == before + 1
    return f"{f'Step {steps} leads' if one else f'Steps {before + 1} to {steps} lead'} back to {first}."


def _about_the_state(state: TeamState, graph: StateGraph, steps: int) -> Iterator[str]:
    """Yield sentences about the state with the fault."""
    stage = graph.stage_of(state)
    waiting = sum(len(queue) for _, queue in state.queues)
    transit = "no message is" if not waiting else "1 message is" if waiting == 1 else f"{waiting:,} messages are"
    yield f"This is the state after {counted(steps, 'step')}; {transit} in transit."
    robots = [*zip(stage.names, graph.robots_in(state), strict=True)]
    values = [f"{name} has {values_text(stage.judge.team, one.assignment) or 'no value'}" for name, one in robots]
    yield f"{'; '.join(values)}."
    for name, one in robots:
        if one.verdict is not None:
            yield f"{name} has concluded {one.verdict}."
