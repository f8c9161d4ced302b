"""A bad history makes predictions no worse than none does, beyond what chance explains."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from typing import Self

import numpy as np
import pytest

from sain_core.model import Model, load_dynamics
from sain_core.push import LENGTH, make_stroke
from sain_core.scene import POSITION, THETA, make_scene, unit
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.shapes.outlines import trace
from sain_core.shapes.shape import FLAT
from sain_core.transitions import PushHistory
from sain_core.types import Pushes, Scenes
from sain_model.dynamics.identify import notices
from sain_model.dynamics.sain import residual_model
from sain_model.inference.kinds import BODY_ON_SURFACE, surface_kind
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.settings import PLANAR
from sain_model.physics.parameters import BY_NAME, TEXTBOOK, PlanarConfig
from sain_model.physics.planar import PlanarPrior
from tests.sain_model.conftest import draw_pushes

DRAWS = 10
WORST = 1.03  # times the mean error without history
NOISE = 0.0007  # [m], of a place, and of a turn as a way of its corners
TESTED = 12  # pushes, in each draw
CORNERS = np.array([(0.0, 0.0), (0.09, 0.0), (0.09, 0.03), (0.03, 0.03), (0.03, 0.06), (0.0, 0.06)])
OUTLINE, MIRRORED = (trace("hook", CORNERS * (way, 1.0)) for way in (1.0, -1.0))
BODIES, MIRROR = (Bodies((one.shape.on(FLAT),)) for one in (OUTLINE, MIRRORED))
RADIUS = OUTLINE.radius
OF_DISKS = ("friction", "tool_friction", "disk_friction", "foot_radius", "length_offset")
TABLE = ("friction", "table_grain_x", "table_grain_y", "torsion", "tool_friction", "tip_x", "tip_y")


@dataclass(frozen=True)
class World:
    """A body on a table, with parameters of its own."""

    config: PlanarConfig
    bodies: Bodies = BODIES

    @classmethod
    def drawn(cls, random: np.random.Generator, disks: bool) -> Self:
        """Return a world where all parameters are drawn as the model believes."""
        usual, bodies = (TEXTBOOK, PAPER_DISKS) if disks else (surface_kind().config, BODIES)
        return cls(usual, bodies).with_drawn(random, *(OF_DISKS if disks else BODY_ON_SURFACE))

    def with_drawn(self, random: np.random.Generator, *names: str) -> Self:
        """Return this world with others of its parameters, where they are not its body's."""
        values, config = {}, TEXTBOOK if self.bodies.are_paper_disks else surface_kind().config
        for one in map(BY_NAME.__getitem__, names):
            usual, z = getattr(config, one.name), one.spread * random.normal()
            value = usual * np.exp(z) if one.logarithm else usual + z
            values[one.name] = float(np.clip(value, one.least, one.most))
        return replace(self, config=replace(self.config, **values))

    def pushed(self, random: np.random.Generator, count: int, aside: float = 0.0) -> PushHistory:
        """Return pushes through the body, or past it by so many radii, as they are seen."""
        if self.bodies.are_paper_disks:
            states, strokes = draw_pushes(count, int(random.integers(1 << 30)))
            strokes[:, LENGTH] *= aside == 0.0
            return self.seen(random, states, strokes)
        poses = np.column_stack([0.5 + random.uniform(-0.05, 0.05, (count, 2))])
        states = np.stack([make_scene(one[None], np.ones(1), np.array([RADIUS])) for one in poses])
        states[:, 0, THETA] = random.uniform(-3.0, 3.0, count)
        heading, off = random.uniform(-np.pi, np.pi, count), random.uniform(-0.3, 0.3, count)
        start = -1.3 * unit(heading) + (aside + off)[:, None] * unit(heading + np.pi / 2)
        strokes = make_stroke(
            poses + RADIUS * start,
            heading,
            random.uniform(0.04, 0.09, count),
            speed=0.05,
            tip_radius=0.005,
        )
        return self.seen(random, states, strokes)

    def seen(self, random: np.random.Generator, states: Scenes, strokes: Pushes) -> PushHistory:
        """Return where pushes lead, as it is seen."""
        after = PlanarPrior(self.config, self.bodies).step(states, strokes)
        moved = (after != states).any(axis=2, keepdims=True)
        noise = NOISE * random.normal(size=(*after.shape[:2], 3)) / (1.0, 1.0, RADIUS)
        after[..., :3] += moved * noise
        return PushHistory(states, strokes, after)


def joined(*some: PushHistory) -> PushHistory:
    return PushHistory(
        *(np.concatenate([getattr(one, name) for one in some]) for name in some[0].arrays)
    )


def moved_aside(history: PushHistory, rows: slice, random: np.random.Generator) -> PushHistory:
    """Return a history whose bodies were seen 50 mm from where some pushes brought them."""
    after = history.next_state.copy()
    off = 0.05 * unit(random.uniform(-np.pi, np.pi, len(after[rows])))
    after[rows, 0, POSITION] += off
    return replace(history, next_state=after)


def slipped(history: PushHistory, rows: slice) -> PushHistory:
    """Return a history where the tool slipped off in some pushes, with a part of the motion."""
    after = history.next_state.copy()
    after[rows] = history.state[rows] + 0.3 * (after[rows] - history.state[rows])
    return replace(history, next_state=after)


Case = Callable[[World, np.random.Generator], tuple[PushHistory, World]]


def outlier(count: int, wrong: int) -> Case:
    return lambda world, random: (
        moved_aside(world.pushed(random, count), slice(count - wrong, None), random),
        world,
    )


def table(before: int, after: int) -> Case:
    def case(world: World, random: np.random.Generator) -> tuple[PushHistory, World]:
        other = world.with_drawn(random, *TABLE)
        history = joined(world.pushed(random, before + after), other.pushed(random, after + 1))
        return history.select(np.r_[:before, before + after : before + 2 * after]), other

    return case


def body(before: int, after: int) -> Case:
    def case(world: World, random: np.random.Generator) -> tuple[PushHistory, World]:
        other = world.with_drawn(random, "pressure", "centre_x", "centre_y", "inertia")
        shifted = replace(other.config, centre_x=world.config.centre_x + 0.2)
        other = replace(other, config=shifted)
        history = joined(world.pushed(random, before + after), other.pushed(random, after + 1))
        return history.select(np.r_[:before, before + after : before + 2 * after]), other

    return case


def tool(count: int, wrong: int) -> Case:
    return lambda world, random: (
        slipped(world.pushed(random, count), slice(count - wrong, None)),
        world,
    )


def shuffled(world: World, random: np.random.Generator) -> tuple[PushHistory, World]:
    return world.pushed(random, 8).select(random.permutation(8)), world


def swapped(world: World, random: np.random.Generator) -> tuple[PushHistory, World]:
    """Return a history where the scenes before and after two pushes changed places."""
    history = world.pushed(random, 8)
    before, after = history.state.copy(), history.next_state.copy()
    before[6:], after[6:] = history.next_state[6:], history.state[6:]
    return PushHistory(before, history.action, after), world


def missed(world: World, random: np.random.Generator) -> tuple[PushHistory, World]:
    return world.pushed(random, 6, aside=3.0), world


def mirrored(world: World, random: np.random.Generator) -> tuple[PushHistory, World]:
    other = replace(world, bodies=MIRROR if world.bodies is BODIES else world.bodies)
    return other.pushed(random, 8), other


CASES: dict[str, Case] = {
    "clean, 1": outlier(1, 0),
    "clean, 8": outlier(8, 0),
    "another table": table(8, 0),
    "another table, then this one": table(8, 2),
    "another table, then 5 here": table(8, 5),
    "another body": body(8, 0),
    "another body, then this one": body(8, 2),
    "outlier, 1 of 1": outlier(1, 1),
    "outlier, 1 of 2": outlier(2, 1),
    "outlier, 2 of 8": outlier(8, 2),
    "tool slipped, 1 of 1": tool(1, 1),
    "tool slipped, 2 of 8": tool(8, 2),
    "out of order": shuffled,
    "scenes swapped": swapped,
    "touches nothing": missed,
    "mirrored": mirrored,
}


def off(model: Model, pushes: PushHistory) -> float:
    """Return the mean error of places [mm]."""
    away = (model.step(pushes.state, pushes.action) - pushes.next_state)[..., POSITION]
    return 1e3 * float(np.linalg.norm(away, axis=-1).mean())


def model_of(disks: bool) -> Model:
    """Return a model that infers from histories: of disks as shipped, of bodies that lie flat."""
    if disks:
        return load_dynamics("sain")
    kind = replace(surface_kind(), corrected=True)
    return residual_model(InteractionNetwork().weights, kind, PLANAR).with_bodies(BODIES)


def errors(case: Case, disks: bool, draws: int = DRAWS) -> np.ndarray:
    """Return errors (draws, 2) [mm] without history and with it."""
    model, found = model_of(disks), []
    for seed in range(draws):
        random = np.random.default_rng((seed, 7))
        history, world = case(World.drawn(random, disks), random)
        test = world.pushed(random, TESTED)
        found.append([off(model, test), off(model.condition(history), test)])
    return np.array(found)


JUDGED = (
    "another table", "another table, then this one", "another body", "outlier, 1 of 1",
    "outlier, 2 of 8", "tool slipped, 2 of 8", "touches nothing", "mirrored",
)  # fmt: skip
NOT_SHOWN = pytest.mark.xfail(reason="a single short way is that of a table with more friction")
PAIRS = [*product(JUDGED, (False, True)), ("tool slipped, 1 of 1", False)]
PAIRS.append(pytest.param("tool slipped, 1 of 1", True, marks=NOT_SHOWN))


@pytest.mark.system
@pytest.mark.parametrize(("name", "disks"), PAIRS)
def test_a_bad_history_is_not_worse_than_none(name, disks):
    without, with_it = errors(CASES[name], disks).T
    excess = with_it - WORST * without
    assert excess.mean() <= 2.0 * excess.std(ddof=1) / np.sqrt(DRAWS)


@pytest.mark.parametrize(
    ("case", "disks", "text"),
    [
        ("outlier, 2 of 8", True, "2 of 8 pushes fit no physics and hardly count"),
        ("tool slipped, 2 of 8", True, "of 8 pushes fit no physics and hardly count"),
        (
            "another table, then 5 here",
            True,
            "do not count: later ones contradict them",
        ),
        ("touches nothing", False, "6 of 6 pushes touch nothing"),
        ("out of order", False, "are out of order, or a body was moved by"),
        ("mirrored", False, "its outline may be mirrored"),
        ("clean, 8", True, ""),
    ],
)
def test_a_bad_history_is_named(case, disks, text):
    found = []
    for seed in range(6):
        random = np.random.default_rng((seed, 7))
        history, _ = CASES[case](World.drawn(random, disks), random)
        jumps = "" if text.startswith("are out") else "out of order"
        said = "; ".join(
            one
            for one in notices(model_of(disks).condition(history))
            if not jumps or jumps not in one
        )
        found.append(text in said if text else not said)
    assert np.mean(found) > 0.5
