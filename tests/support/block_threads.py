"""Blocks of a team in threads of this process: as on a cluster, without Dask."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from queue import Empty, SimpleQueue

from robochoc.communication.arrays.blocks import Block, BlockLostError, BlockReport, Channel

PATIENCE_S = 60.0


class ThreadChannel:
    """The channel of one block: a queue for each pair of blocks."""

    def __init__(self, number: int, queues: Mapping[tuple[int, int], SimpleQueue[bytes]]) -> None:
        self._number, self._queues = number, queues

    def swap(self, outgoing: Mapping[int, bytes], senders: Collection[int]) -> Mapping[int, bytes]:
        for other, content in outgoing.items():
            self._queues[self._number, other].put(content)
        try:
            return {other: self._queues[other, self._number].get(timeout=PATIENCE_S) for other in senders}
        except Empty:
            raise BlockLostError("a block is silent") from None


def run_in_threads(blocks: Sequence[Block], run: Callable[[Block, Channel], BlockReport]) -> list[BlockReport]:
    """Run each block in its own thread, and return the reports."""
    numbers = range(len(blocks))
    queues = {(one, other): SimpleQueue[bytes]() for one in numbers for other in numbers}
    with ThreadPoolExecutor(len(blocks)) as pool:
        futures = [pool.submit(run, block, ThreadChannel(block.number, queues)) for block in blocks]
    errors = [error for future in futures if (error := future.exception())]
    for error in sorted(errors, key=lambda error: isinstance(error, BlockLostError)):
        raise error
    return [future.result() for future in futures]
