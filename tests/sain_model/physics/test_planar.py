"""Laws of the planar prior for bodies of any shape: symmetries, mechanics, contacts."""

from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import InvalidInputError
from sain_core.feasibility import Feasibility
from sain_core.push import (
    BODY,
    LENGTH,
    LOCATION,
    PushLimits,
    make_push,
    mirror_pushes,
    push_direction,
)
from sain_core.scene import (
    MASS,
    MID,
    POSITION,
    THETA,
    X,
    Y,
    make_scene,
    mirror_scenes,
    unit,
    wrap_angle,
)
from sain_core.shapes.bodies import Bodies, Role, overlap
from sain_core.shapes.library import get_shape
from sain_core.shapes.shape import REGULAR_FEET, Shape
from sain_core.shapes.solids import Prism
from sain_core.types import Pushes, Scenes
from sain_model.physics.parameters import AXES
from sain_model.physics.planar import PlanarConfig, PlanarPrior
from tests.strokes import rotate_pushes, rotate_scenes

BATCH = 60
LIMITS = PushLimits()


def prior_of(*shapes: Shape | str, roles: tuple[Role, ...] = ()) -> PlanarPrior:
    found = tuple(get_shape(shape) if isinstance(shape, str) else shape for shape in shapes)
    return PlanarPrior().with_bodies(Bodies(found, roles))


def draw(bodies: Bodies, seed: int = 0, batch: int = BATCH) -> tuple[Scenes, Pushes]:
    """Draw scenes of bodies near each other, and pushes against any of them."""
    random = np.random.default_rng(seed)
    count, scenes = len(bodies), []
    while len(scenes) < batch:
        positions = np.array([0.45, 0.0]) + random.uniform(-0.12, 0.12, (count, 2))
        headings = random.uniform(-3.0, 3.0, count)
        scene = make_scene(
            positions, random.uniform(1.0, 9.0, count), np.full(count, 0.07), headings
        )
        pairs = [(i, j) for j in range(count) for i in range(j)]
        if all(overlap(scene, bodies, *pair) == 0.0 for pair in pairs):
            scenes.append(scene)
    pushes = LIMITS.sample(random, batch)
    pushes[:, BODY] = random.integers(0, count, batch)
    return np.stack(scenes), pushes


def close(first: Scenes, second: Scenes, tolerance: float) -> None:
    np.testing.assert_allclose(first[..., POSITION], second[..., POSITION], atol=tolerance)
    turned = wrap_angle(first[..., THETA] - second[..., THETA])
    np.testing.assert_allclose(turned, 0.0, atol=20 * tolerance)


@pytest.mark.parametrize("config", [PlanarConfig(), AXES])
def test_a_disk_as_a_polygon_moves_like_the_disk(config):
    """64 corners on a circle of a little more than the radius, so that the areas are equal.

    Pushes are against the middles of sides, where polygon and disk have one normal.
    """
    bearings = np.arange(64) * 2 * np.pi / 64
    away = np.sqrt(np.pi / (32 * np.sin(2 * np.pi / 64)))
    corners = tuple((away * np.cos(b), away * np.sin(b)) for b in bearings.tolist())

    class Regular(Prism):
        feet = REGULAR_FEET

    polygon = Regular("nearly round", corners)
    disks = PlanarPrior(config).with_bodies(Bodies.disks(1))
    polygons = PlanarPrior(config).with_bodies(Bodies((polygon,)))
    scenes, pushes = draw(disks.bodies, batch=100)
    scenes[..., THETA] = 0.0
    pushes[:, LOCATION] = (np.floor(pushes[:, LOCATION] * 32 / np.pi) + 0.5) * np.pi / 32
    expected, found = disks.step(scenes, pushes), polygons.step(scenes, pushes)
    moved = np.linalg.norm((expected - scenes)[..., POSITION], axis=-1)
    apart = np.linalg.norm((expected - found)[..., POSITION], axis=-1)[moved > 1e-3]
    assert np.median(apart) < 5e-4
    assert np.quantile(apart, 0.95) < 3e-3


def test_a_straight_push_ends_where_mechanics_says():
    """The box leaves the braking tool at its speed v and slides on by v^2 / (2 mu g)."""
    config = PlanarConfig(tool_restitution=0.0, friction_scale=1.0, yield_across=1.0)
    prior = replace(prior_of("square"), config=config)
    scene = make_scene(np.array([[0.45, 0.0]]), np.array([2.0]), np.array([0.07]))[None]
    after = prior.step(scene, make_push(0.0, 0.0, 0.1)[None])
    slowing = config.friction * config.gravity
    slides = 0.2**2 / 2 * (1 / slowing - 1 / config.acceleration)
    expected = 0.1 - config.clearance + slides
    np.testing.assert_allclose((after - scene)[0, 0, [X, Y]], [expected, 0.0], atol=2e-4)
    np.testing.assert_allclose(after[0, 0, THETA], 0.0, atol=1e-9)


def test_what_is_fixed_stays_and_stops_others():
    fixed = prior_of("square", "bar", roles=(Role.PUSHABLE, Role.FIXED))
    free = prior_of("square", "bar", roles=(Role.PUSHABLE, Role.MOVABLE))
    scene = make_scene(
        np.array([[0.3, 0.0], [0.37, 0.0]]),
        np.array([1.0, 1.0]),
        np.array([0.05, 0.1]),
        np.array([0.0, np.pi / 2]),
    )[None]
    push = make_push(0.0, 0.0, 0.02)[None]
    stopped = fixed.step(scene, push)
    np.testing.assert_array_equal(stopped[0, 1], scene[0, 1])
    assert free.step(scene, push)[0, 1, X] > scene[0, 1, X] + 0.002
    assert overlap(stopped[0], fixed.bodies, 0, 1) < 1e-3


@pytest.mark.parametrize(
    "names", [("t", "u", "triangle"), ("star", "disk", "half_ring"), ("h", "plus", "bar")]
)
def test_bodies_never_end_up_inside_each_other(names):
    prior = prior_of(*names)
    scenes, pushes = draw(prior.bodies, batch=200)
    after = prior.step(scenes, pushes)
    deepest = [
        max(overlap(scene, prior.bodies, *pair) for pair in ((0, 1), (0, 2), (1, 2)))
        for scene in after
    ]
    assert np.quantile(deepest, 0.98) < 1e-4
    assert np.max(deepest) < 3e-3


def test_overlaps_at_the_start_are_undone_without_giving_speed():
    prior = prior_of("square", "square", "t")
    side = 0.05 * np.sqrt(2.0)
    scene = make_scene(
        np.array([[0.3, 0.0], [0.3 + side - 0.001, 0.01], [0.6, 0.2]]),
        np.full(3, 2.0),
        np.full(3, 0.05),
    )[None]
    after = prior.step(scene, make_push([0.0], 0.0, 0.08, body=2))
    moved = np.abs((after - scene)[0, :2, [X, Y]]).max()
    assert 1e-4 < moved < 2e-3
    assert overlap(after[0], prior.bodies, 0, 1) < 1e-4


def test_pushed_disks_move_along_with_the_push_and_gain_no_energy():
    """Nothing gets farther than the tool's way and a slide from its speed, bounce included."""
    prior, (scenes, pushes) = PlanarPrior(), draw(Bodies.disks(3), batch=200)
    pushes[:, BODY] = 0.0
    possible = Feasibility(limits=LIMITS).assess(scenes, pushes).gaps > 0.002
    way = unit(push_direction(pushes))
    moved = (prior.step(scenes, pushes) - scenes)[..., POSITION]
    along = (moved[:, MID] * way).sum(-1)
    assert (along[possible] > -1e-9).all()
    fastest = 0.2 * (1 + prior.config.tool_restitution) * (1 + prior.config.disk_restitution)
    farthest = pushes[:, LENGTH] + fastest**2 / (2 * 0.12 * 9.81)
    distance = np.linalg.norm(moved, axis=-1).max(axis=-1)
    assert (distance[possible] < farthest[possible] + 1e-3).all()


def test_bad_input_is_refused_by_name():
    scenes, pushes = draw(Bodies.disks(2), batch=3)
    broken, other = scenes.copy(), pushes.copy()
    broken[1, 0, X], other[1, BODY] = np.nan, 2.0
    weightless = scenes.copy()
    weightless[2, 1, MASS] = 0.0
    for asked, message in (
        ((broken, pushes), r"scenes\[1, 0, 0\] is nan; it must be finite"),
        ((weightless, pushes), r"mass of disk 1 in scene 2 is 0.0; it must be pos"),
        ((scenes, pushes[:2]), r"pushes have shape \(3, 5\), one for each"),
        ((scenes[:, :0], pushes), r"scenes have shape \(B, N, 8\) with N = 1 to 32"),
        ((scenes, other), "push 1 is against body 2; the scenes have bod"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            PlanarPrior().step(*asked)
    with pytest.raises(InvalidInputError, match=r"shape \(B, N, 8\) with N = 2, not \(3, 1, 8\)"):
        prior_of("t", "l").step(scenes[:, :1], pushes)


def test_friction_along_the_axes_turns_by_quarters_and_in_their_mirror():
    scenes, pushes = draw(Bodies.disks(2), seed=3)
    pushes[:, BODY] = 0.0
    prior = PlanarPrior(AXES)
    expected = prior.step(scenes, pushes)

    def off(angle: float) -> float:
        turned = prior.step(rotate_scenes(scenes, angle), rotate_pushes(pushes, angle))
        away = turned - rotate_scenes(expected, angle)
        return float(np.abs(away[..., POSITION]).max())

    assert off(np.pi / 2) < 1e-6
    assert off(np.pi / 4) > 1e-3
    mirrored = prior.step(mirror_scenes(scenes), mirror_pushes(pushes))
    away = mirrored - mirror_scenes(expected)
    assert np.abs(away[..., POSITION]).max() < 1e-6
