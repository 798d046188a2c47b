"""Strongly connected components of a graph that is given by its successors (Tarjan 1972), without recursion."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator
from typing import TypeVar

Node = TypeVar("Node", bound=Hashable)


def strong_components(first: Node, successors: Callable[[Node], Iterable[Node]]) -> Iterator[set[Node]]:
    """Yield each component with a cycle that can be reached from `first`, as the set of its nodes."""
    lowest: dict[Node, int] = {first: 0}
    numbers: dict[Node, int] = {first: 0}
    stack, is_open = [first], {first}
    loops: set[Node] = set()
    work = [(first, iter(successors(first)))]
    while work:
        node, left = work[-1]
        for after in left:
            if after == node:
                loops.add(node)
            if after not in numbers:
                numbers[after] = lowest[after] = len(numbers)
                stack.append(after)
                is_open.add(after)
                work.append((after, iter(successors(after))))
                break
            if after in is_open:
                lowest[node] = min(lowest[node], numbers[after])
        else:
            work.pop()
            if work:
                above = work[-1][0]
                lowest[above] = min(lowest[above], lowest[node])
            if lowest[node] == numbers[node]:
                component = set()
                while node not in component:
                    component.add(stack.pop())
                is_open -= component
                if len(component) > 1 or node in loops:
                    yield component
