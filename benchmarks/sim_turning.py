"""Whether the world has a preferred direction: the same push, with the whole scene turned.

    ./env python -m benchmarks.sim_turning

Each of some randomised scenes is turned by twelve angles about its mid disk, and pushed once. What
the disks do should turn with it; shown is how far they end from the mean of the twelve, and how far
they were moved.
"""

from math import pi

import numpy as np

from benchmarks.report import Figure, report
from sain_core.push import PushLimits, make_push, rotate_pushes
from sain_core.scene import POSITION, unit
from sain_core.seeding import generator
from sain_core.types import PushArray
from sain_sim.world.parameters import WorldParameters, sample_parameters
from sain_sim.world.world import World

SCENES = 12
TURNS = np.arange(12) * pi / 6
MIDDLE = np.array([0.52, 0.0])  # [m], so that nothing comes near an edge or the arm's limits


def outcomes(parameters: WorldParameters, bearing: float, push: PushArray) -> np.ndarray:
    """Return where the disks end, (12, N, 2) [m] from the mid disk's start, turned back."""
    ends = []
    for turn in TURNS:
        offset = (sum(parameters.radii) + 0.001) * unit(np.asarray(bearing + turn))
        scene = parameters.scene(np.stack([MIDDLE, MIDDLE + offset]), np.array([0.5, 2.0]) + turn)
        turned = rotate_pushes(push, turn)
        with World(parameters) as world:
            world.reset(scene)
            away = world.push(turned).after[:, POSITION] - MIDDLE
        ends.append(np.stack([away @ unit(np.asarray(turn + axis)) for axis in (0.0, pi / 2)], -1))
    return np.array(ends)


def main() -> None:
    """Measure and print."""
    random = generator(0, "benchmarks.sim_turning")
    limits = PushLimits()
    off, moved = [], []
    for _ in range(SCENES):
        parameters = sample_parameters(random)
        bearing = random.uniform(-0.5, 0.5)
        location, angle, length = random.uniform((-0.5, -0.3, 0.06), (0.5, 0.3, 0.10))
        push = limits.check(make_push(bearing + location, angle, length))
        ends = outcomes(parameters, bearing, push)
        off.append(1e3 * np.linalg.norm(ends - ends.mean(axis=0), axis=-1))
        moved.append(1e3 * np.linalg.norm(ends, axis=-1).mean())
    distances = np.concatenate(off)
    figures = [Figure("disks moved, mean", float(np.mean(moved)), "mm")]
    for disk, name in enumerate(("mid disk", "target")):
        errors = distances[:, disk]
        figures.append(Figure(f"{name} off the mean of 12 turns, mean", errors.mean(), "mm"))
        figures.append(Figure("the same, p95", float(np.percentile(errors, 95)), "mm"))
    report("The same push, turned", figures)


if __name__ == "__main__":
    main()
