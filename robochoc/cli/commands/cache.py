"""`robochoc cache`: the cache of solved local problems."""

from __future__ import annotations

import click


@click.group()
def cache() -> None:
    """Show or clear the cache of solved local problems, in your cache folder (XDG_CACHE_HOME, or ~/.cache).

    'robochoc compile' and 'solve' write to the cache. It can be cleared at any time.
    """


@cache.command(short_help="Show the cache's folder and size.")
def show() -> None:
    """Show the folder of the cache, its number of problems, and its size."""
    from robochoc.solver.cache import SolutionCache

    store = SolutionCache()
    sizes = [path.stat().st_size for path in store.files()]
    problems = f"{len(sizes)} problem{'s' * (len(sizes) != 1)}"
    click.echo(f"{store.folder}: {problems}, {sum(sizes):,} bytes")


@cache.command(short_help="Remove all problems from the cache.")
def clear() -> None:
    """Remove all problems from the cache."""
    from robochoc.solver.cache import SolutionCache

    store = SolutionCache()
    removed = store.clear()
    click.echo(f"{store.folder}: {removed} problem{'s' * (removed != 1)} removed")
