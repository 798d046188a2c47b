"""`robochoc generate nary`, `stochastic`, `frequencies`, `heights`, `swarm`, ...: links, lamps, drones, and chance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.generate import OUTPUT, number_option, seed_option, share_option, writes_team
from robochoc.cli.options.sections import COMMON, SectionedCommand
from robochoc.cli.options.value_types import Number, WholeNumber

if TYPE_CHECKING:
    from robochoc.model.problem import Team

MAX_COST = 1_000_000


@click.command(short_help="Model RB: random constraints of any arity.")
@number_option("--agents", "Number of robots.")
@number_option("--domain", "Number of values of each variable.")
@number_option("--constraints", "Number of constraints.", least=0, most=200_000)
@number_option("--arity", "Number of variables of each constraint.", most=10, default=3)
@share_option("--tightness", "Fraction of tuples that a constraint forbids", 0.0)
@click.option(
    "--max-cost",
    type=WholeNumber(0, MAX_COST),
    metavar="COST",
    help="Make a DCOP: each allowed tuple has a cost, uniform from 0 to COST.",
)
@seed_option
@writes_team("nary-AGENTS-DOMAIN-CONSTRAINTSxARITY-TIGHTNESS[-costMAX]-SEED")
def nary(**problem: Any) -> Team:  # noqa: ANN401 - `nary`'s own
    """Random problems with constraints of any arity (Model RB; Xu and Li 2000).

    The scopes are drawn with repetition, and each constraint forbids the same number of tuples. Robot3 has the variable
    V3.

    \b
    robochoc generate nary --agents 10 --domain 3 --constraints 12 --tightness 0.3
    robochoc generate nary --agents 10 --domain 3 --constraints 12 --arity 4 --max-cost 100
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.generators.nary import nary as random_nary

    return random_nary(**problem)


@click.command(short_help="A swarm: drones choose real positions.")
@number_option("--agents", "Number of drones.")
@number_option("--side", "Side of the square, in metres.", least=2, most=1000, default=10)
@number_option("--points", "Points of the first grid, for x and y.", least=2, most=1000, default=9)
@seed_option
@writes_team("swarm-AGENTS-SIDE[-POINTS]-SEED")
def swarm(**problem: Any) -> Team:  # noqa: ANN401 - `swarm`'s own
    """Drones choose real positions near their homes, and in a formation with their neighbours.

    Costs are squares of distances. Robot3 has the variables x3 and y3, in metres with a precision of 0.01.

    \b
    robochoc generate swarm --agents 6
    robochoc generate swarm --agents 20 --side 50 --seed 2
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.generators.swarm import swarm as drones

    return drones(**problem)


@click.command(short_help="Random variables: costs that depend on chance.")
@number_option("--agents", "Number of robots.")
@number_option("--domain", "Number of values of each variable.")
@share_option("--density", "Fraction of pairs of robots that share costs", 0.4)
@number_option("--random", "Number of random variables.", least=0, most=100, default=2)
@number_option("--outcomes", "Number of outcomes of a random variable.", most=10, default=2)
@number_option("--reach", "Number of robots whose costs depend on a random variable.", default=2)
@share_option("--observed", "Probability that such a robot observes the outcome before it chooses", 0.0)
@number_option("--max-cost", "Maximum cost.", least=0, most=MAX_COST, default=10)
@seed_option
@writes_team("stochastic-AGENTS-DOMAIN-DENSITY-RANDOMxOUTCOMES-REACH-OBSERVED-MAX-SEED")
def stochastic(**problem: Any) -> Team:  # noqa: ANN401 - `stochastic`'s own
    """Random problems whose costs depend on chance (StochDCOP; Leaute and Faltings 2011).

    Robot3 has the variable V3; the random variables are r1, r2, ...

    \b
    robochoc generate stochastic --agents 6 --domain 3 --density 0.4
    robochoc generate stochastic --agents 6 --domain 3 --density 0.4 --observed 0.5
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.generators.stochastic import stochastic as random_stochastic

    return random_stochastic(**problem)


@click.command(short_help="Frequency assignment: radio links with little interference.")
@number_option("--agents", "Number of links.")
@number_option("--frequencies", "Number of frequencies.")
@number_option("--side", "Links are at integer coordinates from 0 to N.", most=10_000, default=100)
@number_option("--distance", "Distance at which links interfere.", most=20_000, default=40)
@number_option("--separation", "Separation of links at the same place, in frequencies.", default=3)
@seed_option
@writes_team("frequencies-AGENTS-FREQUENCIES-SIDE-DISTANCE-SEPARATION-SEED")
def frequencies(**problem: Any) -> Team:  # noqa: ANN401 - `frequencies`'s own
    """Frequency assignment with minimum interference (CELAR; Cabon et al. 1999).

    Links within --distance must be separated, the more the nearer they are. A violated separation costs 1, 10, 100 or
    1000.

    \b
    robochoc generate frequencies --agents 12 --frequencies 6
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.generators.frequencies import frequencies as frequency_assignment

    return frequency_assignment(**problem)


@click.command(short_help="Flight heights: two objectives, energy and risk.")
@number_option("--agents", "Number of drones.")
@number_option("--levels", "Number of heights.", least=2, most=100, default=5)
@click.option(
    "--degree",
    type=Number(0),
    default=2.0,
    show_default=True,
    metavar="N",
    help="Average number of crossing paths of a drone.",
)
@number_option("--weight", "Maximum energy of a drone per height.", most=MAX_COST, default=3)
@number_option("--exposure", "Maximum exposure of a drone.", most=MAX_COST, default=3)
@number_option("--crossing", "Maximum risk at neighbouring heights.", most=MAX_COST, default=6)
@seed_option
@writes_team("heights-AGENTS-LEVELS-DEGREE-WEIGHT-EXPOSURE-CROSSING-SEED")
def heights(**problem: Any) -> Team:  # noqa: ANN401 - `heights`'s own
    """Drones choose heights: low ones save energy, high ones are safe, equal ones are dangerous where paths cross.

    \b
    robochoc generate heights --agents 8
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.generators.heights import heights as flight_heights

    return flight_heights(**problem)


@click.command("smart-homes", short_help="Smart lighting: lamps, rules and energy.")
@number_option("--agents", "Number of lamps.")
@number_option("--rules", "Number of rules.", least=0)
@number_option("--levels", "Number of levels of a lamp; level 0 is off.", least=2, most=100, default=5)
@number_option("--lamps", "Number of lamps in a rule.", most=10, default=3)
@number_option("--consumption", "Maximum cost of a lamp per level.", most=MAX_COST, default=3)
@number_option("--importance", "Maximum cost of a difference of 1 in a rule.", most=MAX_COST, default=10)
@seed_option
@writes_team("smart-homes-AGENTS-RULES-LEVELS-LAMPS-CONSUMPTION-IMPORTANCE-SEED")
def smart_homes(**problem: Any) -> Team:  # noqa: ANN401 - `smart_homes`'s own
    """Smart lighting (SECP; Rust, Picard and Ramparany 2016): light as wanted, with little energy.

    A lamp pays for its level, and a rule pays for the difference between the wanted luminosity and the light of its
    lamps.

    \b
    robochoc generate smart-homes --agents 12 --rules 8
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.generators.smart_homes import smart_homes as lighting

    return lighting(**problem)


@click.command(
    "smart-grid",
    cls=SectionedCommand,
    sections={
        COMMON: ("--agents", "--devices", "--slots"),
        "Devices": ("--window", "--duration", "--consumption", "--supply"),
        "Output": OUTPUT,
    },
    short_help="Smart grid: homes share sustainable energy.",
)
@number_option("--agents", "Number of homes.")
@number_option("--devices", "Number of devices of a home.", most=10, default=2)
@number_option("--slots", "Number of time slots.", least=2, default=24)
@number_option("--window", "Number of slots in which a device can start.", default=3)
@number_option("--duration", "Maximum number of slots for which a device runs.", default=3)
@number_option("--consumption", "Maximum consumption of a device in a slot.", most=MAX_COST, default=30)
@number_option("--supply", "Largest sustainable energy in a slot.", least=0, most=MAX_COST, default=40)
@seed_option
@writes_team("smart-grid-AGENTS-DEVICES-SLOTS-WINDOW-DURATION-CONSUMPTION-SUPPLY-SEED")
def smart_grid(**problem: Any) -> Team:  # noqa: ANN401 - `smart_grid`'s own
    """Smart grid (CoLLAB; Mahmud et al. 2025): homes start devices so that little energy exceeds the sustainable one.

    A value is the slot in which a device starts. The cost of a slot is the consumption above its supply.

    \b
    robochoc generate smart-grid --agents 5
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    from robochoc.generators.smart_grid import smart_grid as grid

    return grid(**problem)
