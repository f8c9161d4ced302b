"""Models of gym-pusht by name: the shipped one, its prior alone, the oracle, or any other."""

from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, Final, NamedTuple, Self

import numpy as np

from sain_core.errors import CheckpointError
from sain_core.model import Model, RolloutModel, load_dynamics
from sain_core.push import LENGTH, SPEED, strokes
from sain_core.scene import POSITION, RADIUS, THETA, unit
from sain_core.shapes.bodies import Bodies
from sain_core.types import PushArray, Pushes, Scene, Scenes
from sain_model.dynamics.load import card_path, load_checkpoint, parse_card
from sain_pusht.agent import LIMITS, WALLS
from sain_pusht.block import PIXEL, pixels, pose_of, pusht_bodies, scene_of
from sain_pusht.motion import LANDING, ramp, servo_of
from sain_pusht.world import MOST_STEPS, make_env

GYRATION: Final = "gyration"  # on cards, of the block [radii]
SHIPPED: Final = "pusht"
PRIOR: Final = "prior"
ORACLE: Final = "oracle"
CHECKPOINT: Final = Path(str(resources.files("sain_pusht") / "pusht.safetensors"))


class PushtModel(NamedTuple):
    """What plans, what replaces it where it fails, and the block as these have it."""

    model: RolloutModel
    physics: RolloutModel
    bodies: Bodies


def load_model(name: str) -> PushtModel:
    """Return a model by its name: pusht, prior, oracle, or as in `sain_core.model`.

    Raises:
        ConfigError: an unknown name, or gym-pusht is not installed.
        CheckpointError: a checkpoint that cannot be loaded.
    """
    shipped = load_checkpoint(CHECKPOINT)
    bodies = trained_bodies(CHECKPOINT)
    physics = InsideWalls(shipped.physics, bodies)
    if name == PRIOR:
        return PushtModel(physics, physics, bodies)
    if name == ORACLE:
        return PushtModel(PushtOracle(), physics, bodies)
    model = shipped if name == SHIPPED else load_dynamics(name)
    if name != SHIPPED:
        bodies = trained_bodies(Path(name)) if Path(name).exists() else pusht_bodies()
    return PushtModel(InsideWalls(model, bodies), physics, bodies)


def trained_bodies(path: Path) -> Bodies:
    """Return the block as a checkpoint was trained on it; uniform where its card has nothing.

    Raises:
        CheckpointError: its card cannot be read.
    """
    gyration = parse_card(path, card_path(path).read_text()).data.get(GYRATION, 0.0)
    if not isinstance(gyration, (int, float)) or gyration < 0.0:
        raise CheckpointError(f"{GYRATION} on the card of {path} is {gyration!r}; it must be >= 0")
    return pusht_bodies(float(gyration))


@dataclass(frozen=True, eq=False)
class InsideWalls(Model):
    """A model of one block in a square room, made of a model without walls.

    The block is moved straight back out of a wall. How the wall turns it is left out.
    """

    dynamics: Model
    bodies: Bodies

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return the model for this block."""
        return type(self)(self.dynamics.with_bodies(bodies), bodies)

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Predict the scenes (B, 1, 8) after pushes (B, 5)."""
        after = self.dynamics.step(scenes, pushes)
        corners = self.bodies.shapes[0].outline(1.0)  # (M, 2)
        cos, sin = np.cos(after[:, 0, THETA]), np.sin(after[:, 0, THETA])
        turns = np.stack([np.stack([cos, -sin], -1), np.stack([sin, cos], -1)], 1)  # (B, 2, 2)
        offsets = after[:, :1, RADIUS, None] * np.einsum("bij,mj->bmi", turns, corners)
        places = after[:, :1, POSITION] + offsets  # (B, M, 2)
        low, high = WALLS
        back = np.maximum(low - places.min(axis=1), 0.0)
        back -= np.maximum(places.max(axis=1) - high, 0.0)
        after[:, 0, POSITION] += back
        return after


class PushtOracle(Model):
    """Strokes rolled out in a copy of gym-pusht's own physics: an upper bound for models."""

    def __init__(self) -> None:
        """Make a copy of the world; it is never stepped as an environment."""
        self._inner: Any = make_env(MOST_STEPS).unwrapped
        self._servo = servo_of(self._inner)
        self._bodies = pusht_bodies()

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return the same: there is one body."""
        return self

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Return the scenes (B, 1, 8) after pushes (B, 5), one after another."""
        after = scenes.copy()
        for index, (scene, push) in enumerate(zip(scenes, pushes, strict=True)):
            if push[LENGTH] > 0.0:
                after[index] = self._push(scene, push)
        return after

    def _push(self, scene: Scene, push: PushArray) -> Scene:
        start, heading = strokes(scene, push, LIMITS, self._bodies)
        along = unit(heading)
        places = (
            start + ramp(float(push[LENGTH]), push[SPEED] * self._servo.period)[:, None] * along
        )
        motion = np.stack([start, LANDING * along])
        targets = self._servo.targets(motion, places, {len(places) - 1: np.zeros(2)})
        moved = self._servo.follow(motion, targets)
        inner, pose = self._inner, pose_of(scene)
        inner._setup()
        inner.block.angle = float(pose[2])
        inner.block.position = tuple(pose[:2].tolist())
        inner.agent.position = tuple(pixels(start).tolist())
        for velocity in (moved[:, 1] * [1.0, -1.0] / PIXEL).tolist():
            inner.agent.velocity = tuple(velocity)
            inner.space.step(inner.dt)
        place, angle = inner.block.position, inner.block.angle
        return scene_of(np.array([place.x, place.y, angle]))
