"""How fast the planar prior predicts.

Whole pushes a second on one core and on two. Scenes have two touching disks, pushes come from any
side. Pushes a second fall when others use the machine; processor time per push hardly changes.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numba
import numpy as np

from benchmarks.report import Figure, ReportOptions, read_options, report
from benchmarks.timing import Shortest, fastest
from sain_core.push import PushLimits
from sain_core.randomness import generator
from sain_core.scene import STATE_SIZE, make_scene, unit
from sain_core.shapes.bodies import Bodies
from sain_core.types import Pushes, Scenes
from sain_model.physics.planar import PlanarPrior


@dataclass(frozen=True)
class Options(ReportOptions):
    """How much to measure."""

    batch: int = 4096
    """pushes in a call, B"""
    repeats: int = 9
    """calls, of which the fastest counts"""
    seed: int = 0
    """of scenes and pushes"""


def draw(batch: int, seed: int) -> tuple[Scenes, Pushes]:
    """Draw scenes (B, 2, 8) with the target touching the mid disk anywhere, and pushes (B, 5)."""
    random = generator(seed, "planar benchmark")
    scenes = np.empty((batch, 2, 8))
    for index in range(batch):
        radii = np.array([random.uniform(0.075, 0.085), random.uniform(0.055, 0.065)])
        offset = (radii.sum() + 0.001) * unit(np.array(random.uniform(-np.pi, np.pi)))
        positions = np.array([0.45, 0.0]) + np.stack([np.zeros(2), offset])
        scenes[index] = make_scene(positions, random.uniform(7.0, 9.0, 2), radii)
    return scenes, PushLimits().sample(random, batch)


@contextmanager
def on_threads(threads: int) -> Iterator[None]:
    """Let kernels run on so many threads meanwhile."""
    before = numba.get_num_threads()
    numba.set_num_threads(threads)
    try:
        yield
    finally:
        numba.set_num_threads(before)


def step_time(
    prior: PlanarPrior, scenes: Scenes, pushes: Pushes, repeats: int, threads: int
) -> Shortest:
    """Return how long one push takes a prior that predicts all of them on so many threads."""
    with on_threads(threads):
        call = fastest({"step": lambda: prior.step(scenes, pushes)}, repeats)["step"]
    return Shortest(call.wall / len(scenes), call.processor / len(scenes))


def prior_time(options: Options, threads: int) -> Shortest:
    """Return how long one push of two disks takes the planar prior."""
    return step_time(PlanarPrior(), *draw(options.batch, options.seed), options.repeats, threads)


def bodies_time(options: Options, names: Sequence[str], threads: int) -> Shortest:
    """Return how long one push takes for bodies of these shapes, a few millimetres apart."""
    random = generator(options.seed, "bodies benchmark")
    bodies = Bodies.named(names)
    scenes = np.empty((options.batch, len(names), STATE_SIZE))
    gap, radius = 0.005, 0.06
    for index in range(options.batch):
        places = np.arange(len(names))[:, None] * [[2 * radius + gap, 0.0]] + [0.35, 0.0]
        headings = random.uniform(-np.pi, np.pi, len(names))
        masses = random.uniform(1.0, 3.0, len(names))
        scenes[index] = make_scene(places, masses, np.full(len(names), radius), headings)
    prior, pushes = PlanarPrior().with_bodies(bodies), PushLimits().sample(random, options.batch)
    return step_time(prior, scenes, pushes, options.repeats, threads)


def speed(name: str, push: Shortest, at_least: float | None = None) -> list[Figure]:
    """Return pushes a second, and the processor time that a push takes."""
    return [
        Figure(name, 1.0 / push.wall, "pushes/s", at_least=at_least),
        Figure(f"{name}, processor time", 1e6 * push.processor, "us/push"),
    ]


def main() -> None:
    """Measure how fast models predict pushes."""
    options = read_options(Options, main.__doc__)
    most = min(2, numba.get_num_threads())
    one, two = prior_time(options, 1), prior_time(options, most)
    figures = [
        *speed("planar prior on one core", one),
        *speed(f"planar prior on {most} cores", two, at_least=300_000),
        *speed(f"one T on {most} cores", bodies_time(options, ("t",), most), at_least=150_000),
        *speed(
            f"T, L and U in a row on {most} cores",
            bodies_time(options, ("t", "l", "u"), most),
            at_least=60_000,
        ),
    ]
    report("Models", figures, options.out)


if __name__ == "__main__":
    main()
