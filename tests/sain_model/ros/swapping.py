"""Checkpoints to serve one after another, and what they should answer."""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter

from sain_core.model import load_dynamics
from sain_core.push import PushLimits
from sain_core.ros import codec
from sain_core.scene import make_scene
from sain_interfaces.srv import Rollout
from sain_model.dynamics.checkpoint import ModelCard, save_checkpoint
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.settings import NetworkConfig

SCENE = make_scene(
    np.array([(0.40, 0.0), (0.541, 0.0)]), np.array([8.0, 8.0]), np.array([0.08, 0.06])
)
SEQUENCES = PushLimits().sample(np.random.default_rng(0), 40).reshape(20, 2, 5)


def make_checkpoint(path: Path, seed: int) -> str:
    torch.manual_seed(seed)
    network = InteractionNetwork(NetworkConfig(hidden=8, message=4))
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.add_(0.3 * torch.randn_like(parameter))
    save_checkpoint(path, network, ModelCard("planar", {}, {}))
    return str(path)


def request() -> Rollout.Request:
    made = Rollout.Request(samples=20, horizon=2, disks=2)
    made.scene, made.pushes = codec.encode_floats(SCENE), codec.encode_floats(SEQUENCES)
    return made


def answers_of(*paths: str) -> dict[str, bytes]:
    """Return what each checkpoint answers, by its hash."""
    models = [load_dynamics(path) for path in paths]
    return {model.origin.model_hash: model.rollout(SCENE, SEQUENCES).tobytes() for model in models}


def set_model(graph: Any, name: str) -> Any:
    asked = SetParameters.Request(parameters=[Parameter("model", value=name).to_parameter_msg()])
    return graph.call(SetParameters, "model_node/set_parameters", asked).results[0]
