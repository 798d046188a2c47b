"""`robochoc generate random`, `coloring`, `agentsnet` and `ising`: problems on graphs, with one robot per node."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.generate import (
    GRAPH,
    OUTPUT,
    graph_options,
    number_option,
    pop_graph,
    seed_option,
    writes_team,
)
from robochoc.cli.options.sections import COMMON, SectionedCommand
from robochoc.cli.options.value_types import Finite, Number, WholeNumber

if TYPE_CHECKING:
    from robochoc.model.problem import Team

MAX_COST = 1_000_000
places_option = number_option("--places", "Decimal places of costs.", least=0, most=9, default=0)


@click.command(
    "random",
    cls=SectionedCommand,
    sections={
        COMMON: ("--agents", "--domain", "--density", "--tightness", "--graph"),
        "Graph": GRAPH,
        "Costs": ("--max-cost", "--places", "--maximize", "--asymmetric"),
        "Output": OUTPUT,
    },
    short_help="Model B: random binary constraints, on a graph of your choice.",
)
@graph_options
@number_option("--domain", "Number of values of each variable.")
@click.option("--density", type=Finite(), metavar="P", help="random: fraction of pairs of robots with a constraint.")
@click.option(
    "--tightness",
    type=Finite(),
    metavar="P",
    help="Fraction of pairs of values that a constraint forbids, 0 to 1.  [required; with --max-cost: default 0]",
)
@click.option(
    "--max-cost",
    type=WholeNumber(0, MAX_COST),
    metavar="COST",
    help="Make a DCOP: each allowed pair of values has a cost, uniform from 0 to COST.",
)
@places_option
@click.option("--maximize", is_flag=True, help="With --max-cost: costs are utilities, whose sum is maximised.")
@click.option(
    "--asymmetric", is_flag=True, help="With --max-cost: the two robots of a pair have separate costs (ADCOP)."
)
@seed_option
@writes_team("random-AGENTS-DOMAIN-GRAPH-TIGHTNESS[-costMAX][-asymmetric]-SEED[-connected]")
def random_problem(places: int, *, maximize: bool, **problem: Any) -> Team:  # noqa: ANN401 - `random_csp`'s own
    """Uniform random problems (Model B; Prosser 1996, Gent et al. 2001), the usual benchmark of protocols.

    Exactly the given fractions of pairs are drawn. Robot3 has the variable V3. At --agents 20 --domain 10 --density
    0.2, the problems are hardest at --tightness 0.65, where about half of them have a solution.

    With --max-cost, allowed pairs have costs, whose sum is to be minimised.

    \b
    robochoc generate random --agents 20 --domain 10 --density 0.2 --tightness 0.6
    robochoc generate random --agents 10 --domain 5 --density 0.4 --max-cost 100
    robochoc generate random --agents 30 --domain 3 --graph scale-free --max-cost 9 --places 2
    robochoc generate random --agents 6 --domain 4 --density 0.5 --max-cost 100 --asymmetric
    robochoc generate random --domain 4 --graph town.graphml --tightness 0.3
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.generators.random_csp import random_csp, random_on
    from robochoc.model.cost_units import CostUnits

    if problem["tightness"] is None and problem["max_cost"] is None:
        raise click.UsageError("Missing option '--tightness' (required without --max-cost).")
    if problem["max_cost"] is None and (places or maximize or problem["asymmetric"]):
        raise click.UsageError("--places, --maximize and --asymmetric require --max-cost.")
    problem["tightness"] = problem["tightness"] or 0
    problem["costs"] = CostUnits(maximize, places)
    graph = pop_graph(problem, "density")
    return random_csp(**problem) if graph is None else random_on(graph, **problem)


@click.command(
    cls=SectionedCommand,
    sections={
        COMMON: ("--agents", "--colors", "--degree", "--graph"),
        "Graph": GRAPH,
        "Costs": ("--conflicts", "--max-cost", "--places"),
        "Output": OUTPUT,
    },
    short_help="Graph colouring: hard, soft or weighted.",
)
@graph_options
@number_option("--colors", "Number of values of each variable.", default=3)
@click.option("--degree", type=Finite(), metavar="D", help="random: average number of neighbours.")
@click.option(
    "--conflicts",
    type=click.Choice(["soft", "weighted", "hard"]),
    default="soft",
    show_default=True,
    help="Neighbours of the same colour cost 1, or the random weight of their edge, or are forbidden.",
)
@number_option("--max-cost", "weighted: maximum weight of an edge.", most=MAX_COST, default=10)
@places_option
@seed_option
@writes_team("coloring-AGENTS-COLORS-GRAPH-SEED[-connected]")
def coloring(**problem: Any) -> Team:  # noqa: ANN401 - `coloring`'s own
    """Graph colouring: two neighbours of the same colour cost 1.

    The random graph is uniform among those with exactly AGENTS x DEGREE / 2 edges. Robot3 has the variable V3.

    \b
    robochoc generate coloring --agents 15 --degree 4
    robochoc generate coloring --agents 16 --graph grid --colors 2 --conflicts hard
    robochoc generate coloring --agents 20 --graph small-world --conflicts weighted --max-cost 100
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.generators.coloring import coloring as graph_to_color
    from robochoc.generators.coloring import coloring_of

    graph = pop_graph(problem, "degree")
    return graph_to_color(**problem) if graph is None else coloring_of(graph, **problem)


@click.command(
    cls=SectionedCommand,
    sections={COMMON: ("--task", "--agents", "--graph", "--degree"), "Graph": GRAPH, "Output": OUTPUT},
    short_help="AgentsNet: tasks for teams of language-model agents.",
)
@click.option(
    "--task",
    type=click.Choice(["coloring", "vertex-cover", "matching", "leader-election", "consensus"]),
    required=True,
    help="The problem that the robots solve.",
)
@graph_options
@click.option("--degree", type=Finite(), metavar="D", help="random: average number of neighbours.")
@seed_option
@writes_team("agentsnet-TASK-AGENTS-GRAPH-SEED[-connected]")
def agentsnet(**problem: Any) -> Team:  # noqa: ANN401 - `agentsnet`'s own
    """The tasks of AgentsNet (Groetschla et al. 2025) on a graph: robots talk to their neighbours only.

    A vertex cover is a DCOP, in which each coordinator costs 1; the other tasks are DisCSPs. Robot3 has the variable
    V3.

    \b
    robochoc generate agentsnet --task matching --agents 16 --graph small-world
    robochoc generate agentsnet --task consensus --agents 100 --graph scale-free
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.generators.agentsnet import agentsnet_on
    from robochoc.generators.coloring import random_graph_of

    task, seed = problem.pop("task"), problem.pop("seed")
    graph = pop_graph(problem, "degree")
    return agentsnet_on(random_graph_of(**problem) if graph is None else graph, task, seed)


@click.command(short_help="Ising models: spins on a torus, real couplings.")
@number_option("--rows", "Number of rows.", least=2)
@number_option("--columns", "Number of columns.", least=2)
@click.option(
    "--coupling",
    default=1.6,
    show_default=True,
    type=Number(0, MAX_COST),
    metavar="B",
    help="Couplings are uniform from -B to B.",
)
@click.option(
    "--field",
    default=0.05,
    show_default=True,
    type=Number(0, MAX_COST),
    metavar="R",
    help="Fields are uniform from -R to R.",
)
@number_option("--places", "Decimal places of couplings and fields.", least=0, most=9, default=3)
@seed_option
@writes_team("ising-ROWSxCOLUMNS-B-R-SEED")
def ising(**problem: Any) -> Team:  # noqa: ANN401 - `ising`'s own
    """Ising models on a torus (Cerquides et al. 2018): spins 0 and 1, each with a field and four neighbours.

    Costs are decimals and may be negative; their sum is minimised. Robot2.3 has the variable V2.3.

    \b
    robochoc generate ising --rows 3 --columns 4
    robochoc generate ising --rows 10 --columns 10 --coupling 1 --places 6
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.generators.ising import ising as spins

    return spins(**problem)
