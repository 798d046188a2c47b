"""Blocks of a team on the workers of a Dask cluster: one task for each worker. Extra: `cluster`.

Blocks send each other their borders from worker to worker, over Dask's own connections. The scheduler only starts the
tasks and passes on blocks and reports. If a worker is lost, the run ends with an error: its robots' random numbers and
values are lost too.
"""

from __future__ import annotations

import asyncio
import uuid
from collections import defaultdict
from collections.abc import Collection, Mapping
from contextlib import suppress
from functools import partial

from distributed import CancelledError, Client, Future, Status, Worker, fire_and_forget, get_worker, secede, wait

from robochoc.communication.arrays.blocks import Block, BlockLostError, BlockReport, RunBlock, joined, split_team
from robochoc.communication.arrays.description import Description
from robochoc.communication.cluster_client import SchedulerLostError, connect
from robochoc.communication.search_result import ClusterLostError
from robochoc.system.stopping import stop_requested

PING_S = 2.0
"""The interval at which a waiting block checks that the other block is still there."""
CHECK_S = 1.0
"""The interval at which the client checks that all workers are still there."""
_OPERATION = "robochoc_border"
_Mail = defaultdict[int, asyncio.Queue[bytes]]
_mail: dict[tuple[str, int], _Mail] = {}
"""On a worker: the received contents for each block of a run, by sender. It is used only in the worker's event loop."""


def run_on_cluster(place: str, description: Description, run: RunBlock) -> BlockReport:
    """Run a team on the workers of a cluster, one block each, and return the report of all robots.

    Args:
        place: The cluster's scheduler: see `connect`.
        description: The team.
        run: How to run each block.

    Raises:
        BlockLostError: if there are no workers, a worker is lost, or the run is stopped.
        SchedulerLostError: if the scheduler cannot be reached, or is lost.
        UnsupportedError: if costs are too large.
    """
    with connect(place, "robochoc arrays") as client, client.as_current():
        workers = sorted(_workers(client))
        if not workers:
            raise BlockLostError(f"the cluster at {place} has no workers: start workers by `dask worker`")
        blocks = split_team(description, len(workers), functions=run.form.functions_in_blocks)
        return _run_blocks(client, blocks, run, workers[: len(blocks)])


def _run_blocks(client: Client, blocks: list[Block], run: RunBlock, addresses: list[str]) -> BlockReport:
    """Run each block on the worker at its address."""
    key = uuid.uuid4().hex
    futures: list[Future] = []
    try:
        for block, address in zip(blocks, addresses, strict=True):
            name = f"robochoc-prepare-{key}-{block.number}"
            futures.append(client.submit(_prepare, key, block.number, key=name, workers=[address]))
        _finish(client, futures, addresses)
        prepared = len(futures)
        for block, address in zip(blocks, addresses, strict=True):
            content = client.scatter(block, workers=[address])
            name = f"robochoc-{key}-{block.number}"
            futures.append(client.submit(_run, content, run, key, addresses, key=name, workers=[address]))
        _finish(client, futures, addresses)
        return joined(client.gather(futures[prepared:]))
    except (CancelledError, OSError, KeyError) as error:  # Dask's errors after a loss
        raise _loss(client, addresses, error) from None
    finally:
        with suppress(CancelledError, OSError):
            client.cancel(futures)
            for number, address in enumerate(addresses):
                if address in _workers(client):
                    name = f"robochoc-discard-{key}-{number}"
                    fire_and_forget(client.submit(_discard, key, key=name, workers=[address]))


def _finish(client: Client, futures: list[Future], addresses: list[str]) -> None:
    """Wait for the tasks. Raises the error of a failed task, and `BlockLostError` if a worker is lost meanwhile."""
    while _are_running(futures):
        if lost := {*addresses} - _workers(client):
            raise BlockLostError(_lost(min(lost)))
        if stop_requested():
            raise BlockLostError("the run was stopped: on a cluster, its values are lost")
    _raise_error(futures)


def _loss(client: Client, addresses: list[str], error: BaseException) -> ClusterLostError:
    """Return the loss that has caused an error of Dask."""
    try:
        lost = {*addresses} - _workers(client)
    except (CancelledError, OSError):
        return SchedulerLostError("the scheduler of the cluster was lost: repeat the command")
    return BlockLostError(_lost(min(lost)) if lost else f"a worker was lost: {error}")


def _workers(client: Client) -> set[str]:
    """Return the addresses of the cluster's workers. Raises `OSError` if the scheduler is lost."""
    known = client.scheduler_info(n_workers=-1)
    if "workers" not in known:
        raise OSError("the scheduler is lost")
    return {*known["workers"]}


def _are_running(futures: list[Future]) -> bool:
    """Wait for a moment. Return whether no block has failed, and some blocks are not finished."""
    try:
        wait(futures, CHECK_S)
    except TimeoutError:
        return all(future.status != "error" for future in futures)
    return False


def _raise_error(futures: list[Future]) -> None:
    """Raise the error of a block that has failed. The errors of blocks that wait for it are less important."""
    with suppress(TimeoutError):
        wait(futures, 2 * PING_S)
    errors = [future.exception() for future in futures if future.status == "error"]
    for error in sorted(errors, key=lambda error: isinstance(error, BlockLostError)):
        raise error


def _lost(address: str) -> str:
    return f"the worker at {address} was lost during the run: repeat the command"


async def _prepare(key: str, number: int) -> None:
    """Let this worker receive the borders for a block. Runs in the worker's event loop, since it is asynchronous."""
    get_worker().handlers[_OPERATION] = _receive
    _mail[key, number] = defaultdict(asyncio.Queue)


async def _discard(key: str) -> None:
    """Let the blocks of a run on this worker end."""
    for run, number in list(_mail):
        if run == key:
            del _mail[run, number]


async def _receive(key: str, number: int, sender: int, content: bytes | None) -> bool:
    """Store a border for a block. None only asks whether the block is running. Return whether it is."""
    mail = _mail.get((key, number))
    if mail is not None and content is not None:
        mail[sender].put_nowait(content)
    return mail is not None


def _run(block: Block, run: RunBlock, key: str, addresses: list[str]) -> BlockReport:
    """Run a block in a thread of a worker.

    The block leaves the worker's pool of threads, where the blocks of two runs could wait for each other forever.
    """
    channel = _WorkerChannel(get_worker(), key, block.number, addresses)
    secede()
    try:
        return run(block, channel)
    finally:
        channel.loop.call_soon_threadsafe(partial(_mail.pop, (key, block.number), None))


class _WorkerChannel:
    """The channel of the block `number` on a Dask worker."""

    def __init__(self, worker: Worker, key: str, number: int, addresses: list[str]) -> None:
        self._worker, self.loop = worker, worker.loop.asyncio_loop
        self._key, self._number, self._addresses = key, number, addresses

    def swap(self, outgoing: Mapping[int, bytes], senders: Collection[int]) -> Mapping[int, bytes]:
        """See `Channel.swap`."""
        swapped = asyncio.run_coroutine_threadsafe(self._swap(outgoing, senders), self.loop)
        while True:
            try:
                return swapped.result(PING_S)
            except TimeoutError:
                if swapped.done():
                    raise
                if self._worker.status != Status.running:  # its event loop may have ended
                    raise BlockLostError(_lost(self._worker.address)) from None

    async def _swap(self, outgoing: Mapping[int, bytes], senders: Collection[int]) -> Mapping[int, bytes]:
        await asyncio.gather(*(self._send(other, content) for other, content in outgoing.items()))
        return {other: await self._next(other) for other in senders}

    async def _next(self, sender: int) -> bytes:
        while (mail := _mail.get((self._key, self._number))) is not None:
            try:
                return await asyncio.wait_for(mail[sender].get(), PING_S)
            except TimeoutError:
                try:
                    await self._send(sender, None)
                except BlockLostError:
                    if mail[sender].empty():  # else it has ended after its last message
                        raise
        raise BlockLostError("the run was cancelled")

    async def _send(self, other: int, content: bytes | None) -> None:
        address = self._addresses[other]
        try:
            call = getattr(self._worker.rpc(address), _OPERATION)
            is_running = await call(key=self._key, number=other, sender=self._number, content=content)
        except OSError:
            is_running = False
        if not is_running:
            raise BlockLostError(_lost(address))
