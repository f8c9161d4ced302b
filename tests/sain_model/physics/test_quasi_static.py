"""Slow pushes: what friction alone decides, whatever bodies weigh and however they resist turning.

The reference is quasi-static, with Coulomb's law at each support: of all motions that the tool
allows, a body makes the one in which friction takes the least power (Peshkin and Sanderson,
"Minimization of energy in quasi-static manipulation", IEEE Trans. Robotics and Automation 5, 1989).
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize, minimize_scalar

from sain_core.push import TOOL_RADIUS, make_push
from sain_core.scene import THETA, make_scene, unit
from sain_core.shapes.bodies import Bodies, Role
from sain_core.shapes.library import get_shape
from sain_core.shapes.shape import REGULAR_FEET, feet_places
from sain_core.shapes.solids import flat_bottom
from sain_core.types import Points, Scalars
from sain_model.physics.parameters import TEXTBOOK
from sain_model.physics.planar import PlanarPrior

RADIUS, LENGTH, FRICTION, STEPS = 0.08, 0.1, 0.3, 80
SLOW = replace(
    TEXTBOOK, tool_friction=FRICTION, middle_height=0.0, tool_height=0.0, disk_height=0.0
)
PUSHES = ((0.3, 0.3), (1.0, 0.6), (2.0, -0.7))  # location and angle [rad]
KINDS = {
    "disks": Bodies.disks(2),
    "outlines": Bodies.named(["disk", "square"], [Role.PUSHABLE] * 2),
}


def rotate(points: Points, angle: float) -> Points:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[cos, sin], [-sin, cos]]))


def velocities(twist: np.ndarray, points: Points) -> Points:
    """Of points (F, 2) of a body that moves with (vx, vy, w)."""
    return twist[:2] + twist[2] * np.stack([-points[:, 1], points[:, 0]], axis=1)


def lost(twist: np.ndarray, feet: Points, loads: Scalars) -> float:
    """Return what friction takes; smooth where a foot rests."""
    return float(loads @ np.sqrt((velocities(twist, feet) ** 2).sum(axis=1) + 1e-18))


def creep(way: np.ndarray, normal: np.ndarray, feet: Points, loads: Scalars) -> np.ndarray:
    """Return how a disk moves whose rim is moved along a way [m] by a tool at -normal.

    It moves so that friction takes the least: with the rim, if it sticks, else with a force at
    the edge of the friction cone.
    """
    tangent, arm = np.array([-normal[1], normal[0]]), -RADIUS * normal
    across = np.array([-arm[1], arm[0]])

    def with_rim(spin: float) -> np.ndarray:
        return np.array([*(way - spin * across), spin])

    most = 3.0 * np.hypot(*way) / RADIUS
    spin = minimize_scalar(
        lambda spin: lost(with_rim(spin), feet, loads), bounds=(-most, most), method="bounded",
        options={"xatol": 1e-9 * most},
    ).x  # fmt: skip
    each = velocities(with_rim(spin), feet)
    force = loads @ (each / np.linalg.norm(each, axis=1, keepdims=True))
    if abs(force @ tangent) <= FRICTION * (force @ normal):
        return with_rim(spin)
    edge = normal + np.sign(force @ tangent) * FRICTION * tangent
    wrench = np.array([*edge, across @ edge])
    basis = np.linalg.svd(wrench[None])[2][1:]  # motions that take no power
    first = wrench / (wrench @ wrench)
    found = minimize(
        lambda free: lost(first + free @ basis, feet, loads), np.zeros(2), method="Nelder-Mead",
        options={"xatol": 1e-7, "fatol": 1e-12},
    ).x  # fmt: skip
    twist = first + found @ basis
    along = twist[:2] @ normal + twist[2] * (across @ normal)
    return np.asarray(twist * (way @ normal) / along)


def reference(location: float, angle: float, feet: Points, loads: Scalars) -> np.ndarray:
    """Where a disk ends (x, y [m], theta [rad]) that starts at the origin, on feet (F, 2) [m]."""
    pose, way = np.zeros(3), LENGTH / STEPS * unit(np.array(location + angle))
    tool = -(RADIUS + TOOL_RADIUS + SLOW.clearance) * unit(np.array(location))
    for _ in range(STEPS):
        tool = tool + way
        apart = pose[:2] - tool
        normal = apart / np.hypot(*apart)
        deep = RADIUS + TOOL_RADIUS - np.hypot(*apart)
        if deep > 0.0:
            tangent = np.array([-normal[1], normal[0]])
            rim = deep * normal + (way @ tangent) * tangent
            pose += creep(rim, normal, rotate(feet, pose[2]), loads)
    return pose


@pytest.mark.parametrize(("kind", "bottom"), [("disks", "feet"), ("outlines", "flat")])
def test_a_slow_push_is_quasi_static(kind, bottom):
    """Whatever the inertia and the speed."""
    bodies, config = KINDS[kind].on(bottom), SLOW
    places = np.array([(0.5, 0.0), (0.9, 0.0)])
    scenes = np.repeat(make_scene(places, np.full(2, 8.0), np.full(2, RADIUS))[None], 3, axis=0)
    pushes = make_push(*np.array(PUSHES).T, LENGTH, speed=0.01)
    moved = PlanarPrior(config, bodies).step(scenes, pushes) - scenes
    disk = get_shape("disk")
    if bottom == "feet":
        feet, loads = feet_places(REGULAR_FEET, 1.0), np.full(3, 1.0 / 3.0)
    else:
        feet, loads = flat_bottom(disk)
    for each, push in zip(moved[:, 0, : THETA + 1], PUSHES, strict=True):
        expected = reference(*push, RADIUS * feet, loads)
        assert np.hypot(*(each - expected)[:2]) < 1e-3
        assert each[2] == pytest.approx(expected[2], abs=np.radians(1.0))
    assert np.abs(moved[:, 0, 2]).max() > 0.25
    for inertia, speed in ((0.1, 0.01), (0.8, 0.02)):
        again = PlanarPrior(replace(config, inertia=inertia), bodies).step(
            scenes, make_push(*np.array(PUSHES).T, LENGTH, speed=speed)
        )
        np.testing.assert_allclose(again - scenes, moved, atol=1e-6)


@pytest.mark.parametrize("values", [{"pressure": 2.0, "torsion": 0.6}])
def test_a_flat_bottom_turns_as_its_torsion_says(values):
    points, loads = flat_bottom(get_shape("disk"), values.get("pressure", 0.0))
    places = np.array([(0.5, 0.0), (0.9, 0.0)])
    scene = make_scene(places, np.full(2, 8.0), np.full(2, RADIUS))[None]
    location, angle = PUSHES[1]
    push = make_push([location], angle, LENGTH, speed=0.01)
    each = {name: np.array([[value, 1.0]]) for name, value in values.items()}
    moved = PlanarPrior(SLOW, Bodies.named(["disk:flat"] * 2)).step(scene, push, each) - scene
    feet = values.get("torsion", 1.0) * RADIUS * points
    expected = reference(location, angle, feet, loads)
    assert moved[0, 0, THETA] == pytest.approx(expected[2], abs=np.radians(1.0))
    assert np.hypot(*(moved[0, 0, :2] - expected[:2])) < 1e-3


@pytest.mark.parametrize("name", ["disk", "square"])
def test_a_soft_contact_stays_pressed_in_by_what_friction_takes(name):
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
    ("names", "name"), [(("t",), "tool_compliance"), (("square", "disk"), "body_compliance")]
)
def test_as_compliance_goes_to_zero_contacts_become_rigid(names, name):
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
