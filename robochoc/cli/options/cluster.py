"""The option `--cluster` of commands that run tasks on a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import click

from robochoc.cli.reports.failures import INVALID, LOST, USAGE, Failure

cluster_option = click.option(
    "--cluster",
    metavar="ADDRESS|FILE",
    help="Run on the Dask cluster of this scheduler: tcp://10.0.0.1:8786, or its JSON file.",
)


@contextmanager
def on_cluster(place: str | None) -> Iterator[None]:
    """Prepare the use of a cluster, and convert its loss to a `Failure`. None: no cluster is used.

    Raises:
        Failure: if Dask is not installed, or `place` is not that of a scheduler.
    """
    if place is None:
        yield
        return
    import logging

    from robochoc.communication.cluster_client import address_of, require_dask
    from robochoc.communication.search_result import ClusterLostError
    from robochoc.formats import InvalidInputError
    from robochoc.solver.errors import UnsupportedError

    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)  # Dask would log the loss of a scheduler with a traceback
    try:
        require_dask()
        address_of(place)
        yield
    except InvalidInputError as invalid:
        raise Failure(INVALID, str(invalid)) from None
    except UnsupportedError as refused:
        raise Failure(USAGE, str(refused)) from None
    except ClusterLostError as lost:
        raise Failure(LOST, str(lost)) from None
    finally:
        logging.disable(before)
