"""The best that any model without a memory can do where the friction is hidden.

    ./env python -m benchmarks.without_history data/randomised

No scene shows the friction, so a model that sees nothing else can at best answer with the point
that is nearest, on average, to what comes of all frictions of the randomised world. Here the
simulator itself answers so: with the true masses and radii, at frictions spread evenly over the
range, and with the geometric median of where the target ends. No network that sees one scene does
better on average, whatever its size; what it lacks is in the pushes before.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.progress import track

from benchmarks.report import Figure, report
from sain_core.scene import POSITION, TARGET
from sain_model.data.dataset import Part, load_dataset, split_by_episode
from sain_sim.world.parameters import FRICTION_RANGE, WorldParameters
from sain_sim.world.shadow import TRUE, BulletPrior

ROUNDS = 50  # of Weiszfeld's method: far beyond what 1e-6 m need


@dataclass(frozen=True)
class Command:
    """On which pushes."""

    dataset: Annotated[Path, tyro.conf.Positional]
    """A collection in the randomised world, with floor."""
    every: int = 3
    """Look at every n-th held-out push."""
    frictions: int = 9
    """How many frictions the simulator is asked about."""


def main() -> None:
    """Measure and print."""
    command = tyro.cli(Command, description=main.__doc__)
    held_out = split_by_episode(load_dataset(command.dataset), 0, 0.1, 0.15).test.alike
    data = held_out.select(np.arange(len(held_out)) % command.every == 0)
    least = distances(best_answers(data, command.frictions), data)
    nominal = distances(data.physics_next[:, TARGET, POSITION], data)
    floor = distances(held_out.floor_next[:, TARGET, POSITION], held_out)
    floor = floor[np.isfinite(floor)]
    share = (nominal.mean() - least.mean()) / (nominal.mean() - floor.mean())
    figures = [
        Figure("pushes", float(len(data)), ""),
        Figure("Bullet, nominal: f_p", float(nominal.mean()), "mm"),
        Figure("the simulator, friction not known", float(least.mean()), "mm"),
        Figure("floor", float(floor.mean()), "mm"),
        Figure("most of the reducible error to be removed", 100.0 * float(share), "%"),
    ]
    report("The target's mean error without a memory", figures)


def best_answers(data: Part, count: int) -> np.ndarray:
    """Return where the target is best said to end, (M, 2) [m]."""
    low, high = FRICTION_RANGE
    frictions = low + (high - low) * (np.arange(count) + 0.5) / count
    with BulletPrior(TRUE, parameters=WorldParameters.of_scene(data.state[0])) as bullet:
        answers = []
        for scene, push in track(list(zip(data.state, data.action, strict=True)), transient=True):
            ends = []
            for friction in frictions:
                bullet.truth = WorldParameters.of_scene(scene, friction=float(friction))
                ends.append(bullet.predict(scene, push)[TARGET, POSITION])
            answers.append(geometric_median(np.array(ends)))
    return np.array(answers)


def geometric_median(points: np.ndarray) -> np.ndarray:
    """Return the point (2,) nearest on average to points (K, 2), by Weiszfeld's method."""
    middle = points.mean(axis=0)
    for _ in range(ROUNDS):
        weights = 1.0 / np.maximum(np.linalg.norm(points - middle, axis=1), 1e-9)
        middle = weights @ points / weights.sum()
    return np.asarray(middle)


def distances(ends: np.ndarray, data: Part) -> np.ndarray:
    """Return how far targets that are said to end there are off, (M,) [mm]."""
    return np.asarray(1e3 * np.linalg.norm(ends - data.next_state[:, TARGET, POSITION], axis=-1))


if __name__ == "__main__":
    main()
