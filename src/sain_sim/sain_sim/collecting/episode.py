"""One episode of a collection: a randomised world, a shadow beside it, up to ten pushes.

Paper, section III-B. An episode depends on the collection's seed and its own number alone.
"""

import logging
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from math import pi
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np

from sain_core.config import Config, option
from sain_core.errors import ConfigError, SainError
from sain_core.guarding.untrusted import MOST_BODIES
from sain_core.push import (
    DEFAULT_SPEED,
    SPEED,
    PaperGrid,
    PushLimits,
    make_push,
    pushed_bodies,
    strokes,
)
from sain_core.randomness import generator
from sain_core.scene import MID, POSITION, RADIUS, TARGET, wrap_angle
from sain_core.shapes.bodies import Bodies, Role
from sain_core.shapes.library import check_shapes, get_shape, shape_names
from sain_core.shapes.shape import outline_of
from sain_core.shapes.solids import DISK
from sain_core.transitions import MOVED, ROUGH, Column, Row, describe_bodies, travels
from sain_core.types import PushArray, Scene
from sain_core.world import DivergedError, Outcome, ToppledError
from sain_sim.collecting.shards import PushCounts
from sain_sim.world.own import open_world
from sain_sim.world.parameters import (
    NOMINAL_FRICTION,
    PAPER,
    RANGES,
    WIDE,
    WorldParameters,
    check_stands,
)
from sain_sim.world.shadow import NOMINAL, TRUE, BulletPrior
from sain_sim.world.start import draw_bodies_start, draw_start, wholly_on
from sain_sim.world.truth import LABS, RANDOMISED_TRUTH, TruthConfig
from sain_sim.world.workcell import FREE_TOOL, WorldConfig

AIMED: Final = 0.6  # share of pushes aimed through the target
AIM_SPREAD: Final = 0.35  # [rad], standard deviation of the aim
AIM_WIDTH: Final = 0.6  # [rad], of pushes along an outline
AIM_TRIES: Final = 50
SHORTEST: Final = 0.02  # [m], shortest travel

log = logging.getLogger(__name__)
N = TypeVar("N", int, float)
CIRCLE: Final = "circle"
GRID: Final = "grid"


def draw_circle_push(random: np.random.Generator, scene: Scene, bodies: Bodies) -> PushArray:
    """Draw a push (5,) from any side of disk 0; a share of them roughly through the target."""
    limits = PushLimits()
    angle = random.uniform(-limits.max_angle, limits.max_angle)
    length = random.uniform(SHORTEST, limits.max_length)
    heading = random.uniform(-pi, pi)
    if random.uniform() < AIMED:
        way = scene[TARGET, POSITION] - scene[MID, POSITION]
        heading = np.arctan2(way[1], way[0]) + random.normal(0.0, AIM_SPREAD)
    return make_push(wrap_angle(np.asarray(heading - angle)), angle, length)


def draw_outline_push(random: np.random.Generator, scene: Scene, bodies: Bodies) -> PushArray:
    """Draw a push (5,) evenly along the outlines of all pushable bodies of a scene (N, 8)."""
    shapes = [bodies.shapes[body] for body in bodies.pushable]
    around = [2 * pi if shape.is_round else outline_of(shape).perimeter for shape in shapes]
    lengths = scene[list(bodies.pushable), RADIUS] * around
    body = random.choice(bodies.pushable, p=lengths / sum(lengths.tolist()))
    limits = PushLimits()
    location = -random.uniform(-pi, pi)  # (-pi, pi]
    angle = random.uniform(-limits.max_angle, limits.max_angle)
    return make_push(location, angle, random.uniform(SHORTEST, limits.max_length), body=body)


def draw_aimed_push(random: np.random.Generator, scene: Scene, bodies: Bodies) -> PushArray:
    """Draw a push along an outline; a share of them roughly towards the nearest other body."""
    push = draw_outline_push(random, scene, bodies)
    if len(scene) == 1 or random.uniform() >= AIMED:
        return push
    for _ in range(AIM_TRIES):
        body = int(pushed_bodies(push))
        ways = np.delete(scene[:, POSITION], body, axis=0) - scene[body, POSITION]
        x, y = ways[np.hypot(*ways.T).argmin()]
        heading = strokes(scene, push, PushLimits(), bodies)[1]
        if np.cos(heading - np.arctan2(y, x)) > np.cos(AIM_WIDTH):
            break
        push = draw_outline_push(random, scene, bodies)
    return push


def draw_grid_push(random: np.random.Generator, scene: Scene, bodies: Bodies) -> PushArray:
    """Draw one of the paper's 105 pushes, each as likely (section III-B a)."""
    pushes = PaperGrid().pushes()
    return np.asarray(pushes[random.integers(len(pushes))])


@dataclass(frozen=True)
class EpisodeConfig(Config):
    """What episodes are like."""

    disks: int = option(2, "number of disks N", minimum=2, maximum=5)
    target: str = option(DISK, f"what the target is: {', '.join(shape_names())}")
    shapes: str = option(
        "",
        "shapes with commas between, drawn for each body, and all are pushed; empty: body 0, a"
        " disk, pushes the others",
    )
    bodies: str = option(
        "", "number of bodies with `shapes`, or a range such as 1-3; empty: as many as disks"
    )
    parameters: str = option(
        PAPER,
        "masses, radii and friction: the paper's ranges, or wide ones (5 to 12 kg, radii +-20 %,"
        " friction 0.05 to 0.35)",
        choices=(PAPER, WIDE),
    )
    sampler: str = option(
        CIRCLE, "pushes from any side, or the paper's grid", choices=(CIRCLE, GRID)
    )
    speeds: str = option(
        "",
        "speed of pushes [m/s], or a range such as 0.05-0.2 from which each is drawn by its"
        f" logarithm; empty: {DEFAULT_SPEED}",
    )
    pushes: int = option(10, "largest number of pushes in an episode", minimum=1, maximum=100)
    tries: int = option(
        50, "draws for each push before the episode ends", minimum=1, maximum=10_000
    )
    moved_only: bool = option(
        False, "keep only pushes that move the target by 2 mm (the paper's filter)"
    )
    floor_episodes: int = option(
        0, "number of first episodes whose pushes are repeated with the true parameters", minimum=0
    )
    labs: int = option(
        1,
        "number of laboratories, from `lab` on, one of which is drawn for each episode",
        minimum=1,
        maximum=1_000_000,
    )
    truth: TruthConfig = RANDOMISED_TRUTH

    def __post_init__(self) -> None:
        """Check the fields, and that the target's shape exists."""
        super().__post_init__()
        for name in (self.target, *self.shape_names):
            get_shape(name)
        if self.bodies and not self.shapes:
            raise ConfigError(f"bodies is {self.bodies!r}, and shapes is empty; give both")
        if self.labs > 1 and self.truth.world not in LABS:
            raise ConfigError(
                f"labs is {self.labs}, and world {self.truth.world} is none; use world"
                f" {' or '.join(LABS)}"
            )
        _ = self.counts, self.speed_range  # checks them

    @property
    def shape_names(self) -> tuple[str, ...]:
        """The shapes that bodies are drawn from; none: disks and the target."""
        return tuple(name.strip() for name in self.shapes.split(",") if name.strip())

    @property
    def counts(self) -> tuple[int, ...]:
        """The numbers of bodies that an episode may have."""
        if not self.bodies:
            return (self.disks,)
        first, last = _range(self.bodies, int)
        if not 1 <= first <= last <= MOST_BODIES:
            raise ConfigError(
                f"bodies is {self.bodies!r}; give a number from 1 to {MOST_BODIES}, or a range of"
                " such, as 1-3"
            )
        return tuple(range(first, last + 1))

    @property
    def speed_range(self) -> tuple[float, float]:
        """The slowest and the fastest push [m/s]."""
        limits = PushLimits()
        slowest, fastest = _range(self.speeds or str(limits.speed), float)
        if not limits.min_speed <= slowest <= fastest <= limits.max_speed:
            raise ConfigError(
                f"speeds is {self.speeds!r}; give a speed from {limits.min_speed} to"
                f" {limits.max_speed} m/s, or a range of such, as 0.05-0.2"
            )
        return slowest, fastest


def _range(text: str, number: Callable[[str], N]) -> tuple[N, N]:
    """Return both ends of a range such as 1-3, or a single number twice; zeros: it is none."""
    low, _, high = text.partition("-")
    try:
        return number(low), number(high or low)
    except ValueError:
        return number("0"), number("0")


class EpisodeResult(NamedTuple):
    """What an episode gave."""

    transitions: list[Row]  # in order; with the 2 mm filter only those that pass it
    counts: PushCounts  # of all pushes that were drawn


class EpisodeRunner:
    """Runs episodes one after the other in worlds that it keeps."""

    def __init__(self, seed: int, config: EpisodeConfig) -> None:
        """Build the worlds for episodes of a collection with this seed."""
        self._seed = seed
        self._config = config
        # A tool without an arm ends pushes as one with it, in half the time.
        self._world_config = WorldConfig(robot=FREE_TOOL)
        circle = draw_aimed_push if config.shapes else draw_circle_push
        self._draw = draw_grid_push if config.sampler == GRID else circle
        built = draw_parameters(generator(seed, "build"), config)
        self._world = open_world(built, self._world_config, engine=config.truth.engine)
        self._shadow = BulletPrior(NOMINAL, self._world_config, self._world.parameters)

    def run(self, episode: int) -> EpisodeResult:
        """Return the transitions of one episode, in order, and what became of its pushes."""
        random = generator(self._seed, "episode", episode)
        counts, kept = PushCounts(episodes=1), list[Row]()
        parameters = draw_parameters(random, self._config, counts)
        table = self._world_config.feasibility.table
        draw = draw_bodies_start if self._config.shapes else draw_start
        self._world.reset(draw(random, parameters, table), parameters)
        self._shadow.truth = parameters
        with ExitStack() as stack:
            floor = None
            if episode < self._config.floor_episodes:
                true = BulletPrior(TRUE, self._world_config, parameters, self._world.engine)
                floor = stack.enter_context(true)
            try:
                for step, (push, outcome) in enumerate(self._pushes(random, counts)):
                    has_target = parameters.bodies.has_target
                    travel = float(travels(outcome.before, outcome.after, has_target))
                    if travel >= MOVED or not self._config.moved_only:
                        kept.append(self._row(episode, step, push, outcome, travel >= MOVED, floor))
                    counts.carry_out(travel)
            except DivergedError as error:  # in the truth, or in what predicts: no row can follow
                counts.refuse(error)
                if not isinstance(error, ToppledError):
                    log.warning("an episode ends after %d pushes: %s", counts.valid, error)
        return EpisodeResult(kept, counts)

    def _pushes(
        self, random: np.random.Generator, counts: PushCounts
    ) -> Iterator[tuple[PushArray, Outcome]]:
        """Carry out pushes until there are enough, none is possible, or a body leaves the table."""
        table = self._world_config.feasibility.table
        for _ in range(self._config.pushes):
            done = self._push(random, counts)
            if done is None:
                counts.stuck += 1
                return
            if not done[1].settled or not wholly_on(done[1].after, table):
                counts.edge += 1
                return  # what happens at the edge is not in a plane
            yield done

    def _push(
        self, random: np.random.Generator, counts: PushCounts
    ) -> tuple[PushArray, Outcome] | None:
        """Draw pushes until one can be carried out; None when none could.

        Raises:
            DivergedError: a push has no outcome in a plane.
        """
        scene = self._world.observe()
        for _ in range(self._config.tries):
            push = self._draw(random, scene, self._world.parameters.bodies)
            if self._config.speeds:
                slowest, fastest = self._config.speed_range
                push[SPEED] = slowest * (fastest / slowest) ** random.uniform()
            try:
                return push, self._world.push(push)
            except DivergedError:
                raise
            except SainError as error:  # unreachable or blocked: draw another
                counts.refuse(error)
        return None

    def _row(
        self,
        episode: int,
        step: int,
        push: PushArray,
        outcome: Outcome,
        moved: bool,
        floor: BulletPrior | None,
    ) -> Row:
        before, after = outcome.before, outcome.after
        again = np.full_like(before, np.nan) if floor is None else floor.predict(before, push)
        parameters = self._world.parameters
        row: dict[str, Any] = {
            Column.STATE: before.ravel(),
            Column.ACTION: push,
            Column.PHYSICS_NEXT: self._shadow.predict(before, push).ravel(),
            Column.NEXT_STATE: after.ravel(),
            Column.FLOOR_NEXT: again.ravel(),
            Column.EPISODE: episode,
            Column.STEP: step,
            Column.SEED: self._seed,
            Column.MASSES: parameters.masses,
            Column.RADII: parameters.radii,
            Column.FRICTION: parameters.friction,
            Column.RIM_FRICTION: parameters.rim_friction,
            Column.TOOL_FRICTION: parameters.tool_friction,
            Column.MOVED: moved,
            Column.DURATION: outcome.duration,
        }
        rough = {f"{ROUGH}{name}": v for name, v in parameters.roughness.arrays().items()}
        named = self._config.shapes or not parameters.bodies.are_paper_disks
        return {**row, **(describe_bodies(parameters.bodies) if named else {}), **rough}

    def close(self) -> None:
        """Let go of the worlds."""
        self._world.close()
        self._shadow.close()


def draw_parameters(
    random: np.random.Generator, config: EpisodeConfig, counts: PushCounts | None = None
) -> WorldParameters:
    """Draw what the world of an episode is made of; again, and counted, where a body would tip.

    Raises:
        ConfigError: a body tips over in every world that is drawn.
    """
    for left in reversed(range(config.tries)):
        drawn = _draw_world(random, config)
        try:
            check_stands(drawn, NOMINAL_FRICTION)  # that of the shadow
            break
        except ConfigError:
            if not left:
                raise
            if counts is not None:
                counts.redrawn += 1
    return drawn


def _draw_world(random: np.random.Generator, config: EpisodeConfig) -> WorldParameters:
    ranges, truth = RANGES[config.parameters], config.truth
    if config.labs > 1:
        truth = replace(truth, lab=truth.lab + int(random.integers(config.labs)))
    if config.shapes:
        count = int(random.choice(config.counts))
        names = check_shapes(random.choice(config.shape_names, count).tolist())
        drawn = truth.draw(random, count, ranges, names)
        return replace(drawn, roles=(Role.PUSHABLE,) * count)
    others = (DISK,) * (config.disks - 2)
    names = check_shapes((DISK, config.target, *others))
    return truth.draw(random, config.disks, ranges, names)
