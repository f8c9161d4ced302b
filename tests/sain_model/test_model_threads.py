"""Numba must not drag PyTorch onto all cores."""

import subprocess
import sys

SCRIPT = """
import numpy as np, torch
from sain_core.push import PushLimits
from sain_core.scene import make_scene
from sain_core.seeding import generator
from sain_model.load import load_dynamics

sain = load_dynamics("sain")
scene = make_scene(np.array([[0.45, 0.0], [0.6, 0.0]]), np.full(2, 8.0), np.array([0.08, 0.06]))
pushes = PushLimits().sample(generator(0, "threads"), 64)
sain.step(np.broadcast_to(scene, (64, 2, 8)).copy(), pushes)
print(torch.get_num_threads())
"""


def test_network_keeps_one_thread_after_the_prior_ran() -> None:
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["1"]
