"""The one contract of policies of others: `Policy` sees a scene and a goal, and chooses a push.

What it sees has keys, shapes and units of the LeRobot data sets that ``to_dataset`` writes:

``observation.state`` (N * 8,): x, y, theta, vx, vy, omega, mass and radius of each body.
``observation.environment_state`` (N * 5,): the goal of each body, as `sain_core.goal.OBSERVED`.
``observation.image`` (S, S, 3): the table from above, with the goal, 0 to 255.
``task``: what is to be done, in words.

An action is the five numbers of a push (`sain_core.push`).
"""

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from sain_core.errors import ConfigError
from sain_core.goal import OBSERVED, Goal
from sain_core.guarding.plugins import Plugins
from sain_core.push import PUSH_NAMES, PUSH_SIZE
from sain_core.scene import STATE_NAMES, STATE_SIZE
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scene
from sain_core.view.image import picture_of

STATE: Final = "observation.state"
GOAL: Final = "observation.environment_state"
IMAGE: Final = "observation.image"
ACTION: Final = "action"
TASK: Final = "task"
POLICY: Final = "policy:"  # before a policy's name, where it stands among models
HIT: Final = "Push the mid disk so that it pushes the target disk to the goal."
ALONE: Final = "Push the body to the goal."
OF_A_BODY: Final = {STATE: STATE_SIZE, GOAL: len(OBSERVED)}  # numbers
KNOWN: Final = (
    f"{STATE} with {STATE_SIZE} numbers of each body, {GOAL} with {len(OBSERVED)}, and {IMAGE},"
    " square, in colour"
)
POLICY_HELP: Final = (
    "a policy: its name, module:function of one's own, or the folder where LeRobot saved it"
)

Observation = Mapping[str, Any]


class Policy(ABC):
    """Chooses pushes. A policy of one's own inherits from it and implements `select_action`.

    Attributes:
        features: the shapes of the observations that it takes, by their keys; empty: numbers of as
            many bodies as there are.
    """

    features: Mapping[str, tuple[int, ...]] = {}

    @abstractmethod
    def select_action(self, observation: Observation) -> Any:
        """Return the five numbers of a push for what is seen; see the module."""

    def reset(self) -> None:  # noqa: B027 - there is nothing to forget
        """Forget what was seen: another goal, or another episode, begins."""


POLICIES: Final = Plugins(
    "sain.policies", "policy", more=", module:function, or the folder where LeRobot saved it"
)
PRETRAINED: Final = EntryPoint("pretrained", "sain_core.pretrained:load", POLICIES.group)


def check_policy_name(name: str) -> EntryPoint:
    """Return what makes a policy of this name; nothing is imported.

    Raises `ConfigError`: no installed package offers it, or two do; a folder, without LeRobot.
    """
    if "/" in name or name.startswith("~") or Path(name).is_dir():
        if find_spec("lerobot") is None:
            raise ConfigError(
                f"policy {name} needs LeRobot: pip install '.[lerobot]' in the checkout"
            )
        return PRETRAINED
    if re.fullmatch(r"[\w.]+:[\w.]+", name):
        return EntryPoint(name, name, POLICIES.group)
    return POLICIES.find(name)


def load_policy(name: str) -> Policy:
    """Return the policy of this name, or the one in this folder.

    Raises `ConfigError`: what makes it fails or makes no policy, or it takes other observations
    than there are; `CheckpointError`: the folder cannot be read.
    """
    entry = check_policy_name(name)
    policy = POLICIES.load(entry, lambda make: make(name), name)
    if not isinstance(policy, Policy):
        raise POLICIES.wrong(
            entry,
            f"{entry.value} returned a {type(policy).__name__}; a policy inherits from"
            " sain_core.policy.Policy and implements select_action(observation)",
            name,
        )
    check_features(name, policy.features)
    return policy


def check_features(name: str, features: Mapping[str, tuple[int, ...]]) -> None:
    """Check that there are such observations; raise `ConfigError`, which names the policy."""
    counts = set()
    for key, shape in features.items():
        size, rest = OF_A_BODY.get(key), 0
        if size is not None and len(shape) == 1:
            count, rest = divmod(shape[0], size)
            counts.add(count)
        image = key == IMAGE and len(shape) == 3 and shape[0] == shape[1] and shape[2] == 3
        if rest or not (image or (size is not None and len(shape) == 1)):
            raise ConfigError(f"policy {name} observes {key} {shape}; there are: {KNOWN}")
    if len(counts) > 1:
        raise ConfigError(
            f"policy {name} observes {_shown(features)}, numbers of {sorted(counts)} bodies;"
            f" {KNOWN} must be of as many"
        )


def check_bodies(name: str, features: Mapping[str, tuple[int, ...]], count: int) -> None:
    """Check that a policy takes scenes of so many bodies; raise `ConfigError`."""
    for key, size in OF_A_BODY.items():
        if key in features and features[key] != (size * count,):
            raise ConfigError(
                f"policy {name} observes {_shown(features)}, as in scenes of"
                f" {features[key][0] // size} bodies; this one has {count}: {key} is"
                f" ({size * count},)"
            )


def _shown(features: Mapping[str, tuple[int, ...]]) -> str:
    return " and ".join(f"{key} {shape}" for key, shape in features.items())


def task_of(count: int) -> str:
    """Return in words what is to be done with so many bodies."""
    return HIT if count > 1 else ALONE


def names_of_numbers(count: int) -> dict[str, list[str]]:
    """Return the names of all numbers of an observation and an action, by key; count bodies."""
    bodies = ("mid", "target", *(f"disk{index}" for index in range(2, count)))[:count]
    return {
        STATE: [f"{body}_{name}" for body in bodies for name in STATE_NAMES],
        GOAL: [f"{body}_goal_{name}" for body in bodies for name in OBSERVED],
        ACTION: list(PUSH_NAMES),
    }


def check_names(where: str, stated: Mapping[str, Sequence[str] | None]) -> None:
    """Check what a data set states that its numbers are, by key; raise `ConfigError`.

    A key without names, or of images, states nothing.
    """
    for key, names in stated.items():
        if key not in (*OF_A_BODY, ACTION) or names is None:
            continue
        size = OF_A_BODY.get(key, PUSH_SIZE)
        wanted = names_of_numbers(len(names) // size)[key]
        for place, (name, right) in enumerate(zip(names, wanted, strict=False)):
            if name != right:
                raise ConfigError(f"{where}: number {place} of {key} is {name!r}, not {right!r}")
        if len(names) != len(wanted):
            raise ConfigError(f"{where}: {key} has {len(names)} names; allowed: {size} each")


def observe(
    scene: Scene, goal: Goal, bodies: Bodies, features: Mapping[str, tuple[int, ...]]
) -> Observation:
    """Return what a policy sees of a scene (N, 8) and a goal; an image if it takes one."""
    seen: dict[str, Any] = {
        STATE: scene.ravel().copy(),
        GOAL: goal.observed(len(scene)).ravel(),
        TASK: task_of(len(scene)),
    }
    if IMAGE in features:
        seen[IMAGE] = picture_of(scene, bodies, goal, features[IMAGE][0])
    return seen
