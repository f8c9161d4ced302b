"""The one contract of policies of others: `Policy` sees a scene and a goal, and chooses a push.

What it sees has keys, shapes and units of the LeRobot data sets that ``to_dataset`` writes:

``observation.state`` (N * 8,): x, y, theta, vx, vy, omega, mass and radius of each body.
``observation.environment_state`` (N * 5,): the goal of each body, as `sain_core.goal.OBSERVED`.
``observation.image`` (S, S, 3): the table from above, with the goal, 0 to 255.
``observation.images.NAME`` (H, W, 3): what a camera of the graph sees, likewise.
``task``: what is to be done, in words.

An action is the five numbers of a push (`sain_core.push`).
"""

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from sain_core.errors import ConfigError, InvalidInputError
from sain_core.goal import OBSERVED, Goal
from sain_core.guarding.plugins import Plugins
from sain_core.push import PUSH_NAMES
from sain_core.scene import STATE_NAMES, STATE_SIZE
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scene
from sain_core.view.image import picture_of
from sain_core.wire.images import CAMERAS, Colour

STATE: Final = "observation.state"
GOAL: Final = "observation.environment_state"
IMAGE: Final = "observation.image"
ACTION: Final = "action"
TASK: Final = "task"
HIT: Final = "Push the mid disk so that it pushes the target disk to the goal."
ALONE: Final = "Push the body to the goal."
NUMBERS: Final = {STATE: STATE_SIZE, GOAL: len(OBSERVED)}  # of a body
POLICY: Final = "policy:"  # before a policy's name, where it stands among models
MOST_SIDE: Final = 10_000  # of a shape
POLICY_HELP: Final = (
    "a policy: its name, module:function of one's own, or the folder where LeRobot saved it"
)

Observation = Mapping[str, Any]
Shapes = Mapping[str, tuple[int, ...]]  # of observations, by key
See = Callable[[str, float], Colour]  # what a camera saw after a time [s], by key
ANY: Final[Shapes] = MappingProxyType({})


class Policy(ABC):
    """Chooses pushes. A policy of one's own inherits from it and implements `select_action`.

    Attributes:
        features: shapes of the observations that it takes; empty: all but an image, of any number
            of bodies.
        version: what tells apart what was trained, such as a SHA-256 of the weights: evaluations
            of another are not continued.
    """

    features: Shapes = ANY
    version = ""

    @abstractmethod
    def select_action(self, observation: Observation) -> Any:
        """Return the five numbers of a push for what is seen; see the module."""

    def reset(self, seed: int) -> None:  # noqa: B027 - there is nothing to forget
        """Forget what was seen: a goal begins. Draw from this seed on, if at all."""


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
            raise ConfigError(f"policy {name} needs LeRobot; install it: pip install '.[lerobot]'")
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
        wrong = f"{entry.value} returned a {type(policy).__name__}; a policy inherits from"
        wrong += " sain_core.policy.Policy and implements select_action(observation)"
        raise POLICIES.wrong(entry, wrong, name)
    if not _are_shapes(policy.features):
        wrong = f"its features are {policy.features!r}; needed: shapes, tuples of whole numbers"
        raise POLICIES.wrong(entry, f"{wrong} of 1 to {MOST_SIDE}, by key", name)
    check_features(name, policy.features)
    return policy


def _are_shapes(features: object) -> bool:
    return isinstance(features, Mapping) and all(
        isinstance(key, str)
        and isinstance(shape, tuple)
        and all(type(side) is int and 1 <= side <= MOST_SIDE for side in shape)
        for key, shape in features.items()
    )


def check_features(name: str, features: Shapes, count: int | None = None) -> None:
    """Check that a policy takes observations that there are, of so many bodies if it is given.

    Raises `ConfigError`, which names the policy.
    """
    for key, shape in features.items():
        size, numbers = shape[0] if shape else 0, NUMBERS.get(key, 0)
        count = count or (size // numbers if numbers else None)  # all are of as many
        right: tuple[int, ...] = (numbers * (count or 0),)
        if not numbers:
            sides = (size, size) if key == IMAGE else shape[:2] if key.startswith(CAMERAS) else ()
            right = (*sides, 3)
        if shape != right or not size:
            raise ConfigError(
                f"policy {name} observes {key} {shape}; there are, with {count or 'any'} bodies,"
                f" {STATE} with 8 numbers of each, {GOAL} with 5, square {IMAGE} in colour, and in"
                f" a graph {CAMERAS}NAME of cameras, in colour; choose another policy or scene"
            )


def names_of_numbers(count: int) -> dict[str, list[str]]:
    """Return the names of all numbers of an observation and an action, by key; count bodies."""
    bodies = ("mid", "target", *(f"disk{index}" for index in range(2, count)))[:count]
    return {
        STATE: [f"{body}_{name}" for body in bodies for name in STATE_NAMES],
        GOAL: [f"{body}_goal_{name}" for body in bodies for name in OBSERVED],
        ACTION: list(PUSH_NAMES),
    }


def check_names(where: str, stated: Mapping[str, Sequence[str] | None]) -> None:
    """Check the names that a data set states for its numbers; raise `ConfigError`."""
    for key in filter(stated.get, (*NUMBERS, ACTION)):
        names = list(stated[key] or ())
        wanted = names_of_numbers(len(names) // NUMBERS.get(key, len(names)))[key]
        if names != wanted:
            raise ConfigError(f"{where}: {key} has {', '.join(names)}; not {', '.join(wanted)}")


def task_of(count: int) -> str:
    """Return in words what is to be done with so many bodies."""
    return HIT if count > 1 else ALONE


def cameras_of(features: Shapes) -> tuple[str, ...]:
    """Return the keys of the images of cameras among some observations."""
    return tuple(key for key in features if key.startswith(CAMERAS))


def no_camera(key: str, after: float = 0.0) -> Colour:
    """Raise `ConfigError`: there is no camera."""
    raise ConfigError(
        f"{key} is what a camera sees, and only a graph has one: ros2 run sain_bringup closed_loop"
        " --policy, or graph"
    )


def observe(
    scene: Scene,
    goal: Goal,
    bodies: Bodies,
    features: Shapes = ANY,
    see: See = no_camera,
    time: float = 0.0,
) -> Observation:
    """Return what a policy sees of a scene (N, 8) of a time [s], and a goal; images if it does.

    Raises `InvalidInputError`: a camera's image has another size; and what `see` raises.
    """
    count, image = len(scene), features.get(IMAGE)
    numbers = {STATE: scene.ravel().copy(), GOAL: goal.observed(count).ravel()}
    images = {IMAGE: picture_of(scene, bodies, goal, image[0])} if image else {}
    for key in cameras_of(features):
        images[key] = see(key, time)
        if images[key].shape != features[key]:
            raise InvalidInputError(
                f"{key} has the shape {images[key].shape}; the policy takes {features[key]}"
            )
    return numbers | images | {TASK: task_of(count)}
