"""Slow pushes: what friction alone decides, whatever bodies weigh and however they resist turning.

The reference is quasi-static. A body moves along the normal of an ellipsoid: pushed with a force f
at p, by v = f and w = (p x f) / c^2, where c is its torsion length (Lynch, Maekawa and Tanie,
"Manipulation and active sensing by pushing using tactile feedback", IROS 1992).
"""

from dataclasses import replace

import numpy as np
import pytest

from sain_core.push import TOOL_RADIUS, make_push
from sain_core.scene import THETA, make_scene, rotate_scenes, unit
from sain_core.shapes.bodies import Bodies, Role
from sain_core.shapes.library import get_shape
from sain_core.shapes.supports import flat_bottom
from sain_core.types import Scalars
from sain_model.physics.planar import PlanarPrior
from sain_model.physics.planar_config import AXES, TEXTBOOK, PlanarConfig

RADIUS, LENGTH, FRICTION = 0.08, 0.1, 0.3
SLOW = replace(
    TEXTBOOK,
    tool_friction=FRICTION,
    middle_height=0.0,
    tool_height=0.0,
    disk_height=0.0,
)
PUSHES = ((0.3, 0.3), (1.0, 0.6), (2.0, -0.7))  # location and angle [rad]
KINDS = {"disks": None, "outlines": Bodies.named(["disk", "square"], [Role.PUSHABLE] * 2)}


def reference(location: float, angle: float, torsion: float, steps: int = 4000) -> np.ndarray:
    """Where a disk ends (x, y [m], theta [rad]) that starts at the origin."""
    pose, way = np.zeros(3), LENGTH / steps * unit(np.array(location + angle))
    tool = -(RADIUS + TOOL_RADIUS + SLOW.clearance) * unit(np.array(location))
    for _ in range(steps):
        tool = tool + way
        apart = pose[:2] - tool
        normal = apart / np.hypot(*apart)
        deep = RADIUS + TOOL_RADIUS - np.hypot(*apart)
        if deep <= 0.0:
            continue
        tangent = np.array([-normal[1], normal[0]])
        arm = -RADIUS * normal
        across = np.array([-arm[1], arm[0]])
        give = np.eye(2) + np.outer(across, across) / torsion**2
        force = np.linalg.solve(give, deep * normal + (way @ tangent) * tangent)
        if abs(force @ tangent) > FRICTION * (force @ normal):
            edge = normal + np.sign(force @ tangent) * FRICTION * tangent
            force = deep / (normal @ give @ edge) * edge
        pose += [*force, across @ force / torsion**2]
    return pose


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("inertia", [0.1, 0.43, 0.8])
@pytest.mark.parametrize("speed", [0.01, 0.02])
def test_a_slow_push_is_quasi_static(kind: str, inertia: float, speed: float) -> None:
    bodies, config = KINDS[kind], replace(SLOW, inertia=inertia)
    prior = PlanarPrior(config) if bodies is None else PlanarPrior(config, bodies)
    places = np.array([(0.5, 0.0), (0.9, 0.0)])
    scenes = np.repeat(make_scene(places, np.full(2, 8.0), np.full(2, RADIUS))[None], 3, axis=0)
    pushes = make_push(*np.array(PUSHES).T, LENGTH, speed=speed)
    moved = (prior.step(scenes, pushes) - scenes)[:, 0, : THETA + 1]
    for found, push in zip(moved, PUSHES, strict=True):
        expected = reference(*push, SLOW.foot_radius * RADIUS)
        assert np.hypot(*(found - expected)[:2]) < 1e-3
        assert found[2] == pytest.approx(expected[2], abs=np.radians(1.0))
    assert np.abs(moved[:, 2]).max() > 0.3


@pytest.mark.parametrize("base", [TEXTBOOK, PlanarConfig(), AXES])
@pytest.mark.parametrize("names", [("disk", "disk"), ("t", "bar"), ("star", "ellipse")])
def test_any_speed_inertia_and_friction_leave_bodies_near(
    base: PlanarConfig, names: tuple[str, ...]
) -> None:
    """What is pushed goes no further than the push, and than it slides on."""
    random = np.random.default_rng(0)
    scene = make_scene(
        np.array([(0.5, 0.0), (0.64, 0.03)]), np.array([8.0, 3.0]), np.array([0.07, 0.06])
    )
    for _ in range(10):
        low, high = [0.01, 0.1, 0.05], [0.5, 1.5, 2.0]
        speed, friction, inertia = np.exp(random.uniform(np.log(low), np.log(high))).tolist()
        config = replace(base, friction=friction, inertia=inertia)
        prior = PlanarPrior(config, Bodies.named(list(names), [Role.PUSHABLE] * 2))
        scenes = np.repeat(scene[None], 20, axis=0)
        ways = random.uniform((-3.0, -0.7), (3.0, 0.7), (20, 2))
        pushes = make_push(*ways.T, LENGTH, speed=speed)
        after = prior.step(scenes, pushes)
        assert np.isfinite(after).all()
        moved = np.linalg.norm((after - scenes)[:, 0, :2], axis=-1)
        assert (moved < LENGTH + 2.0 * speed**2 / (2.0 * friction * config.gravity) + 5e-3).all()


@pytest.mark.parametrize("values", [{"pressure": 0.0}, {"pressure": 2.0}, {"torsion": 0.6}])
def test_a_flat_bottom_turns_as_its_torsion_says(values: dict[str, float]) -> None:
    points, shares = flat_bottom(get_shape("disk"), values.get("pressure", 0.0))
    torsion = values.get("torsion", 1.0) * RADIUS * float(shares @ np.hypot(*points.T))
    places = np.array([(0.5, 0.0), (0.9, 0.0)])
    scene = make_scene(places, np.full(2, 8.0), np.full(2, RADIUS))[None]
    location, angle = PUSHES[1]
    push = make_push([location], angle, LENGTH, speed=0.01)
    each = {name: np.array([[value, 1.0]]) for name, value in values.items()}
    moved = PlanarPrior(replace(SLOW, bottom="flat")).step(scene, push, each) - scene
    expected = reference(location, angle, torsion)
    assert moved[0, 0, THETA] == pytest.approx(expected[2], abs=np.radians(1.5))
    assert np.hypot(*(moved[0, 0, :2] - expected[:2])) < 2e-3


@pytest.mark.parametrize("name", ["disk", "square"])
def test_a_soft_contact_stays_pressed_in_by_what_friction_takes(name: str) -> None:
    """The table holds the body with mu m g when the tool has stopped: it is behind by s mu m g."""
    softness, mass = np.array([0.0, 1e-6, 1e-5, 1e-4, 3e-4]), 3.0
    scene = make_scene(np.array([(0.5, 0.0)]), np.array([mass]), np.array([RADIUS]))[None]
    scenes, pushes = np.repeat(scene, 5, axis=0), make_push(0.0, 0.0, np.full(5, 0.05), speed=0.01)
    prior = PlanarPrior(SLOW, Bodies.named([name]))
    values = {"tool_compliance": softness, "speed_factor": np.full(5, 0.1)}
    moved = (prior.step(scenes, pushes, values) - scenes)[:, 0, 0]
    pressed = softness * SLOW.friction * mass * SLOW.gravity
    np.testing.assert_allclose(moved[0] - moved, pressed, atol=2e-5)


@pytest.mark.parametrize(
    ("names", "name"),
    [
        (("disk",), "tool_compliance"),
        (("t",), "tool_compliance"),
        (("star",), "tool_compliance"),
        (("disk", "disk"), "body_compliance"),
        (("square", "ellipse"), "body_compliance"),
    ],
)
def test_as_compliance_goes_to_zero_contacts_become_rigid(
    names: tuple[str, ...], name: str
) -> None:
    random, count = np.random.default_rng(1), len(names)
    places = np.array([(0.5, 0.0), (0.68, 0.03)])[:count]
    scene = make_scene(places, np.array([8.0, 3.0])[:count], np.array([0.07, 0.06])[:count])
    scenes = np.repeat(scene[None], 40, axis=0)
    ways = random.uniform((-0.3, -0.4), (0.3, 0.4), (40, 2))
    pushes = make_push(*ways.T, LENGTH, speed=random.uniform(0.01, 0.3, 40))
    fine = replace(TEXTBOOK, longest_step=0.002)
    prior = PlanarPrior(fine, Bodies.named(list(names), [Role.PUSHABLE] * count))
    rigid = prior.step(scenes, pushes)
    np.testing.assert_array_equal(prior.step(scenes, pushes, {name: np.zeros(40)}), rigid)

    def off(softness: float) -> Scalars:
        after = prior.step(scenes, pushes, {name: np.full(40, softness)})
        return np.linalg.norm((after - rigid)[..., :2], axis=-1).max(axis=1)

    soft = off(1e-4)
    counts = soft > 1e-6  # in these pushes such a contact is made at all
    assert counts.sum() > 10
    assert np.median(off(1e-8)[counts]) < min(1e-4, 0.2 * np.median(soft[counts]))


def test_a_push_along_the_line_through_the_centre_of_mass_does_not_turn() -> None:
    scene = make_scene(np.array([(0.5, 0.0)]), np.array([8.0]), np.array([RADIUS]))[None]
    scenes, pushes = np.repeat(scene, 2, axis=0), make_push([0.0, np.pi / 2], 0.0, LENGTH)
    off = {"centre_x": np.full(2, 0.2)}
    along, across = PlanarPrior(SLOW, Bodies.named(["disk"])).step(scenes, pushes, off)[:, 0, THETA]
    assert along == pytest.approx(0.0, abs=1e-6)
    assert abs(across) > 0.1


@pytest.mark.parametrize("names", [("t", "bar"), ("star", "square")])
def test_bodies_on_flat_bottoms_turn_with_the_scene(names: tuple[str, ...]) -> None:
    prior = PlanarPrior(
        replace(TEXTBOOK, bottom="flat"), Bodies.named(list(names), [Role.PUSHABLE] * 2)
    )
    places = np.array([(0.5, 0.0), (0.64, 0.03)])
    scene = make_scene(places, np.array([8.0, 7.0]), np.array([0.07, 0.06]), np.array([0.3, 1.0]))
    random = np.random.default_rng(3)
    ways = random.uniform((-3.0, -0.7), (3.0, 0.7), (20, 2))
    pushes = make_push(*ways.T, LENGTH)
    scenes = np.repeat(scene[None], 20, axis=0)
    after = prior.step(scenes, pushes)
    turned = prior.step(rotate_scenes(scenes, 0.9), pushes)
    off = turned[..., :2] - rotate_scenes(after, 0.9)[..., :2]
    assert np.quantile(np.abs(off), 0.95) < 1e-4
    feet = PlanarPrior(TEXTBOOK, prior.bodies).step(scenes, pushes)
    assert np.abs(after - feet)[..., :2].max() > 1e-3
