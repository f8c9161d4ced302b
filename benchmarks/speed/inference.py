"""How fast SAIN predicts.

A rollout of K = 1024, H = 15, N = 2 in this process, beside PyTorch step by step, and the share of
the machine's measured matrix-multiply peak that the network part reaches.
Times are the shortest of many, taken in turns. Processor time hardly depends on who else uses the
machine; the load average says whether anybody did.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass

import numba
import numpy as np
import torch

from benchmarks.report import Figure, ReportOptions, read_options, report
from benchmarks.speed.planar_prior import draw
from benchmarks.timing import fastest
from sain_core.model import Model, load_dynamics
from sain_core.types import Pushes, Scenes
from sain_model.dynamics.sain import SainDynamics, weights_of
from sain_model.network.interaction_network import TorchNetwork
from sain_model.network.weights import DYNAMICS, RELATION

SAMPLES, HORIZON = 1024, 15
SIZE = 1024  # of the square matrices that show the machine's peak


@dataclass(frozen=True)
class Options(ReportOptions):
    """How much to measure."""

    model: str = "sain"
    """name or checkpoint; a network on the planar prior"""
    repeats: int = 30
    """calls of each, of which the fastest counts"""
    seed: int = 0
    """of scenes and pushes"""


class Reference(Model):
    """SAIN step by step, its network run by PyTorch."""

    def __init__(self, sain: SainDynamics) -> None:
        self.prior, self.network = sain.physics, TorchNetwork(weights_of(sain), "cpu")

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        return self.network.correct(scenes, pushes, self.prior.step(scenes, pushes))


def peak(threads: int) -> Callable[[], object]:
    """Return a multiplication of large matrices in single precision, on so many threads."""
    left, right = torch.rand(SIZE, SIZE), torch.rand(SIZE, SIZE)

    def multiply() -> None:
        torch.set_num_threads(threads)
        torch.mm(left, right)
        torch.set_num_threads(1)

    return multiply


def multiplications(sain: SainDynamics, disks: int) -> float:
    """Return the floating-point operations of the network's products for one push."""
    tensors = weights_of(sain).tensors

    def of(part: str) -> float:
        return 2.0 * sum(
            tensors[name].size for name in tensors if name.startswith(part) and "weight" in name
        )

    return disks * (disks - 1) * of(RELATION) + disks * of(DYNAMICS)


def rollouts(sain: SainDynamics, options: Options) -> list[Figure]:
    """Measure rollouts in this process."""
    threads = numba.get_num_threads()
    scenes, pushes = draw(SAMPLES * HORIZON, options.seed)
    scene, sequences = scenes[0], pushes.reshape(SAMPLES, HORIZON, -1)
    predicted = sain.rollout(scene, sequences)
    before = np.concatenate(  # every scene that the rollout corrects a prediction for
        [np.broadcast_to(scene, (SAMPLES, 1, *scene.shape)), predicted[:, :-1]], axis=1
    ).reshape(-1, *scene.shape)
    physics = sain.physics.step(before, pushes)
    reference = Reference(sain)
    far = np.abs(reference.rollout(scene, sequences) - predicted)[..., :2].max()
    times = fastest(
        {
            "rollout": lambda: sain.rollout(scene, sequences),
            "network": lambda: sain.correct(before, pushes, physics),
            "reference": lambda: reference.rollout(scene, sequences),
            "peak": peak(threads),
        },
        options.repeats,
    )
    work = multiplications(sain, len(scene)) * len(pushes)
    most = 2.0 * SIZE**3 / times["peak"].wall
    rollout, network, old = times["rollout"], times["network"], times["reference"]
    return [
        Figure(f"rollout on {threads} cores", 1e3 * rollout.wall, "ms", at_most=60.0),
        Figure("PyTorch step by step / rollout", old.wall / rollout.wall, "times"),
        Figure("the same in processor time", old.processor / rollout.processor, "times"),
        Figure("difference of the two", 1e9 * far, "nm", at_most=1000.0),
        Figure(f"matrix-multiply peak of {threads} cores", 1e-9 * most, "GFLOP/s"),
        Figure("share of the peak, network and features", work / network.wall / most, ""),
    ]


def main() -> None:
    """Measure how fast SAIN predicts."""
    options = read_options(Options, main.__doc__)
    sain = load_dynamics(options.model)
    if not isinstance(sain, SainDynamics):
        sys.exit(f"{options.model} has no network")
    figures = rollouts(sain, options)
    title = f"Inference, K = {SAMPLES}, H = {HORIZON}, N = 2"
    report(title, figures, options.out)


if __name__ == "__main__":
    main()
