"""Small networks run on one of PyTorch's threads, whatever ran before."""

import subprocess
import sys

SCRIPT = """
import numpy as np, torch
from sain_core.push import PushLimits
from sain_core.scene import make_scene
from sain_core.randomness import generator
from sain_core.model import load_dynamics
from sain_model.network.torch_network import TorchNetwork

sain = load_dynamics("sain")
scene = make_scene(np.array([[0.45, 0.0], [0.6, 0.0]]), np.full(2, 8.0), np.array([0.08, 0.06]))
pushes = PushLimits().sample(generator(0, "threads"), 64)
scenes = np.broadcast_to(scene, (64, 2, 8)).copy()
torch.set_num_threads(1)
after = sain.step(scenes, pushes)
print(torch.get_num_threads())
torch.set_num_threads(2)
TorchNetwork(sain.network.module, "cpu").correct(scenes, pushes, after)
print(torch.get_num_threads())
"""


def test_the_kernels_leave_pytorch_its_threads_and_its_network_takes_one() -> None:
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["1", "1"]
