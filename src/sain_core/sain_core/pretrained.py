"""LeRobot, where it is installed: its data sets, and the policies that it trained and saved.

Import `lerobot` only through this module, or after it.
"""

import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy import ndarray

from sain_core.errors import CheckpointError, ConfigError
from sain_core.guarding.documents import read_json
from sain_core.guarding.untrusted import one_line
from sain_core.policy import ACTION, IMAGE, TASK, Observation, Policy, check_names
from sain_core.push import PUSH_NAMES, PUSH_SIZE
from sain_core.storage import hash_files
from sain_core.wire.images import CAMERAS

os.environ.setdefault("HF_HUB_OFFLINE", "1")  # nothing here needs a hub; read on import
declared: Final = torch.library.Library("torchvision", "FRAGMENT")  # for as long as this lives


def _import_torchvision() -> None:
    """Import what `lerobot` imports, also beside a PyTorch for CPUs.

    Torchvision's wheels are built for CUDA. Without it their operators cannot be loaded, and their
    Python part, of which `lerobot` needs a little, asks that one of them be declared at least.
    """
    with warnings.catch_warnings(action="ignore", category=UserWarning):
        try:
            import torchvision
        except RuntimeError:
            for name in [name for name in sys.modules if name.partition(".")[0] == "torchvision"]:
                del sys.modules[name]
            declared.define("nms(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
            import torchvision  # noqa: F401


_import_torchvision()

from lerobot.datasets.lerobot_dataset import LeRobotDataset  # noqa: E402
from lerobot.datasets.utils import write_info, write_stats  # noqa: E402
from lerobot.utils.utils import SuppressProgressBars  # noqa: E402

__all__ = ["LeRobotDataset", "SuppressProgressBars", "load", "write_info", "write_stats"]


class LeRobotPolicy(Policy):
    """A policy of any of LeRobot's classes, with the normalisation that it was trained with."""

    def __init__(self, folder: Path) -> None:
        """Load a folder that `save_pretrained` wrote, with its two processors.

        Raises `CheckpointError`: a file is missing or damaged; `ConfigError`: its actions are no
        pushes, or its data set states other numbers.
        """
        from lerobot.configs.policies import PreTrainedConfig
        from lerobot.policies.factory import get_policy_class, make_pre_post_processors

        with _blaming(folder / "config.json"):
            config = PreTrainedConfig.from_pretrained(folder)
            shape = tuple(config.output_features[ACTION].shape)
        if shape != (PUSH_SIZE,):
            push = f"{(PUSH_SIZE,)}, a push: {', '.join(PUSH_NAMES)}"
            raise ConfigError(f"policy {folder} has actions of shape {shape}; allowed: {push}")
        _check_data_set(folder)
        weights = folder / "model.safetensors"
        with _blaming(weights):
            self.version = hash_files([weights])
            self._policy = get_policy_class(config.type).from_pretrained(folder, config=config)
        shapes = {key: tuple(one.shape) for key, one in config.input_features.items()}
        self.features = {k: s[1:] + s[:1] if _is_image(k) else s for k, s in shapes.items()}
        device = {"device_processor": {"device": str(config.device)}}
        with _blaming(f"one of {folder}/policy_*"):  # their own errors name what is missing
            both = make_pre_post_processors(config, str(folder), preprocessor_overrides=device)
        self._before, self._after = both

    def select_action(self, observation: Observation) -> ndarray:
        """Return the action (5,), made as `lerobot-eval` does."""
        batch: dict[str, Any] = {TASK: [observation[TASK]]}
        for key in self.features:
            values = torch.from_numpy(np.asarray(observation[key], dtype=np.float32))[None]
            batch[key] = values.permute(0, 3, 1, 2) / 255.0 if _is_image(key) else values
        with torch.inference_mode():
            action = self._after(self._policy.select_action(self._before(batch)))
        return np.asarray(action.cpu().numpy()[0])

    def reset(self, seed: int) -> None:
        """Forget the observations and actions that wait."""
        torch.manual_seed(seed)
        self._policy.reset()


def _is_image(key: str) -> bool:
    return key == IMAGE or key.startswith(CAMERAS)


def load(name: str) -> LeRobotPolicy:
    """Return the policy in a folder.

    Raises `CheckpointError`: there is none; or as `LeRobotPolicy`.
    """
    folder = Path(name).expanduser()
    if not (folder / "config.json").is_file():
        raise CheckpointError(
            f"{folder} holds no config.json; give the folder that LeRobot saved, as"
            " outputs/train/NAME/checkpoints/last/pretrained_model"
        )
    return LeRobotPolicy(folder)


@contextmanager
def _blaming(path: Path | str) -> Iterator[None]:
    """Raise `CheckpointError`, which names a file, of what its content makes others raise."""
    try:
        yield
    except ImportError:  # a kind of policy may need more than LeRobot
        raise
    except Exception as error:  # LeRobot, draccus and safetensors raise many kinds
        why = f"{type(error).__name__}: {one_line(error)}; save or copy it again"
        raise CheckpointError(f"{path} is missing or damaged: {why}") from error


def _check_data_set(folder: Path) -> None:
    """Check what the data set that a policy was trained on states, where it is still there."""
    training = folder / "train_config.json"  # of LeRobot's own command
    with _blaming(training):
        trained = read_json(training) if training.is_file() else {}
        root = (trained.get("dataset") or {}).get("root")
    about = Path(root or folder) / "meta/info.json"
    if about.is_file():
        with _blaming(about):
            features = read_json(about)["features"]
            stated = {key: one.get("names") for key, one in features.items()}
        check_names(f"policy {folder} was trained on {about}", stated)
