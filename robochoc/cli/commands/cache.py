"""`robochoc cache`: what is kept of solved local problems, and how to be rid of it."""

from __future__ import annotations

import click


@click.group()
def cache() -> None:
    """The cache of local problems that were solved before, in your cache folder (XDG_CACHE_HOME, or ~/.cache).

    compile and solve fill it by themselves. It is safe to remove at any time: what is missing is solved again.
    """


@cache.command(short_help="Where the cache is, and how large.")
def show() -> None:
    """Say where the cache is, how many problems it holds, and how large it is."""
    from robochoc.solver.cache import SolutionCache

    store = SolutionCache()
    sizes = [path.stat().st_size for path in store.files()]
    problems = f"{len(sizes)} problem{'s' * (len(sizes) != 1)}"
    click.echo(f"{store.folder}: {problems}, {sum(sizes):,} bytes")


@cache.command(short_help="Remove what is in the cache.")
def clear() -> None:
    """Remove all problems from the cache."""
    from robochoc.solver.cache import SolutionCache

    store = SolutionCache()
    gone = store.clear()
    click.echo(f"{store.folder}: {gone} problem{'s' * (gone != 1)} removed")
