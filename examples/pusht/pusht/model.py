"""Models of gym-pusht by name: `pusht`, a fitted prior, and `pusht_oracle`, its own physics."""

from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from pusht.block import BODIES, PIXEL, SHAPE, WALLS, metres, pixels, pose_of, scene_of
from pusht.motion import HIGH, LANDING, LOW, Servo, direction, shut_off
from pusht.world import make_env
from sain_core.model import Model
from sain_core.push import LENGTH, SPEED, PushLimits, strokes
from sain_core.scene import MASS, POSITION, RADIUS, THETA, unit
from sain_core.shapes.bodies import Bodies
from sain_model.physics.planar import PlanarConfig, PlanarPrior

# Nothing slides in gym-pusht: a block that is not pushed stops at once. The closest that the planar
# prior has is a table with much friction. What remains is how blocks turn: there, by their inertia,
# and not by where they stand. So supports stand where they give the same turn. Support, centre of
# mass, friction of the tool and `block.GYRATION` were fitted to 600 random pushes.
PHYSICS: Final = PlanarConfig(
    friction=2.0,
    gravity=24.0,
    friction_scale=1.0,
    foot_radius=0.5592,
    tool_friction=0.0,
    tool_restitution=0.0,
    centre_x=-0.000881,
    centre_y=-0.052682,
    acceleration=6.4,
    speed_factor=0.5,
    longest_step=1 / 120,
)
LOW_WALL, HIGH_WALL = np.sort(metres(np.array([WALLS, WALLS]).T), axis=0)  # (2,) each [m]


@dataclass(frozen=True, eq=False)
class InRoom(Model):
    """A model of one block in gym-pusht's room, made of a model without walls.

    A push that the disk does not get to, or that leads it into a wall, moves nothing: the world
    refuses it. The block is moved straight back out of a wall. How the wall turns it is left out.
    """

    dynamics: Model
    bodies: Bodies = BODIES

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return the model for this block."""
        return replace(self, dynamics=self.dynamics.with_bodies(bodies), bodies=bodies)

    def step(self, scenes: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        """Predict the scenes (B, 1, 8) after pushes (B, 5)."""
        after = self.dynamics.step(scenes, pushes)
        places = _corners(after)
        after[:, 0, POSITION] += np.maximum(LOW_WALL - places.min(axis=1), 0.0)
        after[:, 0, POSITION] -= np.maximum(places.max(axis=1) - HIGH_WALL, 0.0)
        start, heading = strokes(scenes, pushes, PushLimits(), self.bodies)
        ends = pixels(np.stack([start, start + pushes[:, LENGTH, None] * unit(heading)]))
        possible = ((ends >= LOW) & (ends <= HIGH)).all(axis=(0, 2)) & (pushes[:, LENGTH] > 0.0)
        possible &= ~shut_off(ends[0], pixels(_corners(scenes)))
        return np.where(possible[:, None, None], after, scenes)


def _corners(scenes: np.ndarray) -> np.ndarray:
    """Return the corners (B, M, 2) [m] of blocks (B, 1, 8)."""
    cos, sin = np.cos(scenes[:, 0, THETA]), np.sin(scenes[:, 0, THETA])
    turns = np.stack([np.stack([cos, -sin], -1), np.stack([sin, cos], -1)], 1)  # (B, 2, 2)
    outlines = np.einsum("bij,mj->bmi", turns, SHAPE.outline(1.0))
    return scenes[:, :1, POSITION] + scenes[:, :1, RADIUS, None] * outlines


class Oracle(Model):
    """Strokes rolled out in a copy of gym-pusht's own physics: an upper bound for models."""

    def __init__(self) -> None:
        """Make a copy of the world; it is never stepped as an environment."""
        self._env = make_env()
        self._env.reset()
        self._servo = Servo.of(self._env)

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return the same: there is one body."""
        return self

    def step(self, scenes: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        """Return the scenes (B, 1, 8) after pushes (B, 5), one after another."""
        return np.array([self._push(*row) for row in zip(scenes, pushes, strict=True)])

    def _push(self, scene: np.ndarray, push: np.ndarray) -> np.ndarray:
        place, heading = strokes(scene, push, PushLimits(), BODIES)
        start, end = pixels(np.stack([place, place + push[LENGTH] * unit(heading)]))
        motion = np.array([start, LANDING * direction(start, end)])
        places = self._servo.stroke(start, end, push[SPEED] / PIXEL)
        targets = self._servo.targets(motion, places, {len(places) - 1: np.zeros(2)})
        env, pose = self._env, pose_of(scene)
        env._setup()
        env.block.angle = float(pose[2])
        env.block.position = tuple(pose[:2].tolist())
        env.agent.position = tuple(start.tolist())
        for velocity in self._servo.follow(motion, targets)[:, 1].tolist():
            env.agent.velocity = tuple(velocity)
            env.space.step(env.dt)
        return scene_of(np.array([*env.block.position, env.block.angle]), scene[0, MASS])


def load(name: str) -> Model:
    """Return the model of this name; the entry points in `pyproject.toml` lead here."""
    return InRoom(Oracle() if name == "pusht_oracle" else PlanarPrior(PHYSICS, BODIES))
