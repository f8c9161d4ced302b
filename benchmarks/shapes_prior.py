"""How well the planar prior predicts each shape: ``./env python -m benchmarks.shapes_prior``.

Random pushes by the arm in Bullet, with the true parameters, beside the prior with and without the
solver's axes. The floor is Bullet against itself, with the contact point moved by 0.1 mm.
"""

from dataclasses import dataclass
from math import pi
from pathlib import Path

import numpy as np
import tyro

from benchmarks.report import Figure, report
from sain_core.errors import SainError
from sain_core.push import LOCATION
from sain_core.scene import POSITION, THETA, wrap_angle
from sain_core.seeding import generator
from sain_core.shapes.bodies import Bodies
from sain_core.types import PushArray, Scene, Scenes
from sain_model.physics.planar import PlanarConfig, PlanarPrior
from sain_model.physics.planar_config import AXES
from sain_sim.world.parameters import WorldParameters
from sain_sim.world.workcell import WorldConfig
from sain_sim.world.world import World

SHAPES = [
    "disk",
    "cube",
    "box_2x1",
    "bar",
    "triangle",
    "hexagon",
    "ellipse",
    "t",
    "l",
    "u",
    "plus",
    "star",
    "half_ring",
]
MASS, RADIUS, FRICTION = 8.0, 0.08, 0.12  # [kg], [m]
MOVED = 1e-4  # [m], pushes that moved the body less are left out
ASIDE = 1e-4  # [m], how far the contact point is moved for the floor
PRIORS = {"prior": PlanarConfig(), "prior with axes": AXES}


@dataclass(frozen=True)
class Options:
    """How much to measure."""

    pushes: int = 200
    """pushes of each shape"""
    shapes: tuple[str, ...] = tuple(SHAPES)
    """shapes by name"""
    seed: int = 0
    """of scenes and pushes"""
    out: Path | None = None
    """write the figures to this JSON file"""


@dataclass(frozen=True)
class Pushed:
    """Pushes of one shape: scenes before, pushes (B, 5), scenes after, and after others aside."""

    before: Scenes
    pushes: np.ndarray
    after: Scenes
    aside: Scenes


def push_in_bullet(shape: str, options: Options) -> Pushed:
    """Push a body of some shape at random places, each time also a little aside."""
    random = generator(options.seed, f"shapes benchmark {shape}")
    shapes = (shape,)
    parameters = WorldParameters((MASS,), (RADIUS,), shapes, friction=FRICTION)
    rows: list[tuple[np.ndarray, ...]] = []
    with World(parameters, WorldConfig(full_motion=False)) as world:

        def after(scene: Scene, push: PushArray) -> Scene:
            world.load(scene, parameters)
            return world.push(push).after

        limits = world.config.feasibility.limits
        while len(rows) < options.pushes:
            place = np.array([[random.uniform(0.38, 0.52), random.uniform(-0.15, 0.15)]])
            scene = parameters.scene(place, np.array([random.uniform(-pi, pi)]))
            push = limits.sample(random, 1)[0]
            other = push.copy()
            other[LOCATION] = wrap_angle(push[LOCATION] + ASIDE / RADIUS)
            try:
                rows.append((scene, push, after(scene, push), after(scene, other)))
            except SainError:  # out of reach, or too near an inner corner
                continue
    return Pushed(*map(np.array, zip(*rows, strict=True)))


def errors(found: Scenes, true: Scenes) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors of place [mm] and heading [degrees] of body 0, (B,) each."""
    apart = np.linalg.norm((found - true)[:, 0, POSITION], axis=-1)
    turned = np.abs(wrap_angle((found - true)[:, 0, THETA]))
    return 1e3 * apart, np.degrees(turned)


def figures(name: str, place: np.ndarray, heading: np.ndarray) -> list[Figure]:
    """Return median and 95th percentile of errors."""
    rows = (("place", place, "mm"), ("heading", heading, "deg"))
    return [
        Figure(f"{name}, {what}, {label}", float(np.quantile(values, share)), unit)
        for what, values, unit in rows
        for label, share in (("median", 0.5), ("p95", 0.95))
    ]


def main() -> None:
    """Measure how well the planar prior predicts each shape."""
    options = tyro.cli(Options, description=main.__doc__)
    found: list[Figure] = []
    pooled: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for shape in options.shapes:
        data = push_in_bullet(shape, options)
        moved = np.linalg.norm((data.after - data.before)[:, 0, POSITION], axis=-1) > MOVED
        predicted = {
            name: PlanarPrior(config)
            .with_bodies(Bodies.named([shape]))
            .step(data.before, data.pushes)
            for name, config in PRIORS.items()
        }
        for name, scenes in (*predicted.items(), ("floor", data.aside)):
            off = errors(scenes[moved], data.after[moved])
            pooled.setdefault(name, []).append(off)
            found += figures(f"{shape}, {name}", *off)
    for name, offs in pooled.items():
        found += figures(f"all, {name}", *map(np.concatenate, zip(*offs, strict=True)))
    report("Prior of shapes", found, options.out)


if __name__ == "__main__":
    main()
