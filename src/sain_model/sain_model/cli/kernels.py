"""``python -m sain_model.cli.kernels``: compile every kernel before anybody needs it.

The set-up runs this; `sain_model.compute.kernel_store` runs it for each chain, in processes of
their own.
"""

import sys
from collections.abc import Callable
from time import perf_counter
from typing import Final

import numpy as np

from sain_core.errors import ModelUnavailableError
from sain_core.push import PushLimits, as_strokes, make_push
from sain_core.scene import MASS, RADIUS, X
from sain_core.shapes.bodies import Bodies
from sain_model.compute.kernel_store import compile_visibly, kernel_folder

# Kernels are compiled for the types of arrays and settings, not for sizes: one network and an
# ensemble run the same machine code.
SCENES: Final = np.zeros((1, 2, 8))
SCENES[..., MASS], SCENES[..., RADIUS] = 8.0, 0.06
SCENES[:, 1, X] = 0.2
PUSHES: Final = make_push(0.05, 0.05, 0.05)[None]
STROKES: Final = as_strokes(SCENES, PUSHES, PushLimits())


def run_pushes() -> None:
    """Run what pushes bodies."""
    from sain_model.physics.planar import PlanarPrior

    PlanarPrior().step(SCENES, STROKES)


def run_network() -> None:
    """Run the network and what makes its inputs, which regions and training use."""
    from sain_model.dynamics.sain import PhysicsPrediction, ResidualNetwork
    from sain_model.network.features import network_inputs, push_frames
    from sain_model.network.settings import NetworkConfig
    from sain_model.network.weights import untrained

    physics = PhysicsPrediction(SCENES, PUSHES, SCENES)
    ResidualNetwork(untrained(NetworkConfig())).correct(physics)
    frames = push_frames(SCENES, PUSHES, Bodies.disks(2))
    network_inputs(NetworkConfig(), SCENES, frames, SCENES, Bodies.disks(2))


RUNS: Final[dict[str, Callable[[], None]]] = {"pushes": run_pushes, "network": run_network}


def main() -> int:
    """Compile all kernels; or one chain of them."""
    if sys.argv[1:2] == ["--chain"]:
        RUNS[sys.argv[2]]()
        return 0
    start = perf_counter()
    try:
        compile_visibly()
    except ModelUnavailableError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    sys.stdout.write(f"kernels are in {kernel_folder()} ({perf_counter() - start:.1f} s)\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
