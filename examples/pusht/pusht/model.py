"""Models of Push-T: `pusht`, contacts without friction, and `pusht_oracle`, its own physics."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Self

import numpy as np
import shapely

from pusht.block import DISK, PIXEL, WALLS, Block, T, metres, pixels
from pusht.contact import push_blocks
from pusht.motion import LANDING, Hull, Room, Servo, direction
from pusht.press import SUBSTEPS, begin, creep, press_blocks
from pusht.world import make_env
from sain_core.errors import ConfigError
from sain_core.model import Model
from sain_core.push import LENGTH, SPEED, PushLimits, strokes
from sain_core.scene import MASS, POSE, POSITION, THETA, unit, wrap_angle
from sain_core.shapes.bodies import Bodies

REACH: Final = 100.0  # [px], of an action of stable-worldmodel's: its action_scale
SLOP: Final = 0.1 * PIXEL  # [m], depth that pymunk leaves: its collision_slop
FAR: Final = 300.0  # [px], within which two bodies that touch can be moved apart
SLIM: Final = PushLimits(tool_radius=0.001)  # the planner's tool, where the agent is no disk
LOW_WALL, HIGH_WALL = np.sort(metres(np.array([WALLS, WALLS]).T), axis=0)  # (2,) each [m]


@dataclass(frozen=True, eq=False)
class Contacts(Model):
    """One block in the room, moved by the disk and walls as impulses without friction would.

    A push that the disk does not get to, or that leads it into a wall, moves nothing: the world
    refuses it.
    """

    block: Block = T
    disk: float = DISK  # [px], its radius

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return the same: the block is given; raises `ConfigError` for another."""
        if bodies != self.block.bodies:
            names = ", ".join(shape.name for shape in bodies.shapes)
            raise ConfigError(f"this model is of one {self.block.shape.name!r}, not of {names}")
        return self

    def step(self, scenes: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        """Predict the scenes (B, 1, 8) after pushes (B, 5)."""
        start, heading = strokes(scenes, pushes, self._limits, self.block.bodies)
        way = pushes[:, LENGTH, None] * unit(heading)
        after, room = scenes.copy(), Room(self.disk)
        possible = room.contains(pixels(np.stack([start, start + way]))).all(axis=0)
        possible &= pushes[:, LENGTH] > 0.0
        possible[possible] &= ~room.shut_off(
            pixels(start[possible]), self._corners(scenes[possible])
        )
        moved = self.moved(scenes[possible, 0], start[possible], way[possible])
        after[possible, 0, POSE] = moved
        return after

    def moved(self, states: np.ndarray, starts: np.ndarray, ways: np.ndarray) -> np.ndarray:
        """Return the poses (B, 3) of blocks (B, 8) after the disk went by ways (B, 2)."""
        poses, walls = np.ascontiguousarray(states[:, POSE]), (LOW_WALL, HIGH_WALL)
        poses = push_blocks(poses, starts, ways, self.disk * PIXEL, *self.block.table, *walls)
        poses[:, 2] = wrap_angle(poses[:, 2])
        return poses

    @cached_property
    def _limits(self) -> PushLimits:
        return PushLimits(tool_radius=self.disk * PIXEL)

    def _corners(self, scenes: np.ndarray) -> np.ndarray:
        """Return the corners (B, M, 2) [px] of blocks (B, 1, 8)."""
        cos, sin = np.cos(scenes[:, 0, THETA]), np.sin(scenes[:, 0, THETA])
        turns = np.stack([np.stack([cos, -sin], -1), np.stack([sin, cos], -1)], 1)  # (B, 2, 2)
        outlines = np.einsum("bij,mj->bmi", turns, self.block.shape.outline(self.block.radius))
        return pixels(scenes[:, :1, POSITION] + outlines)


class Presses(Model):
    """One block, moved by an agent that is no disk, at the angle at which it was last seen.

    Poses of the agent are those of its centroid, in our frame.
    """

    def __init__(self, block: Block, tool: Block) -> None:
        """Take the block, and the agent."""
        self.block, self.tool, self.angle = block, tool, 0.0
        self.room = Hull(0.0)  # of the agent's centroid
        self.place = np.zeros(2)  # where that is [px]

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return the same: the block is given."""
        return self

    def step(self, scenes: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        """Predict the scenes (B, 1, 8) after pushes (B, 5)."""
        start, heading = strokes(scenes, pushes, SLIM, self.block.bodies)
        ways, after = pushes[:, LENGTH, None] * unit(heading), scenes.copy()
        poses, begun = press_blocks(
            np.ascontiguousarray(scenes[:, 0, POSE]), start, ways, *self._given, LOW_WALL, HIGH_WALL
        )
        begun = pixels(begun)
        possible = self.room.contains(begun) & (pushes[:, LENGTH] > 0.0)
        if possible.any():
            block = shapely.Polygon(pixels(self.block.shape.placed(scenes[0, 0])))
            possible &= self.room.reaches(self.place, begun, block)
        poses[:, 2] = wrap_angle(poses[:, 2])
        after[possible, 0, POSE] = poses[possible]
        return after

    def start(self, scene: np.ndarray, push: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return where the agent begins a push (2,) [m], and its way (2,) [m] until it ends."""
        start, heading = strokes(scene, push, SLIM, self.block.bodies)
        along = unit(heading)
        given = self._given
        begun = begin(scene[0, POSE].copy(), start, along, given[0], given[1], given[2], given[5])
        return begun[:2], push[LENGTH] * along

    def follow(self, agent: np.ndarray, state: np.ndarray, target: np.ndarray) -> np.ndarray:
        """Return the poses (2, 3) of agent and block after a step of control with a target [m]."""
        agent, pose = agent.copy(), state[POSE].copy()
        for _ in range(SUBSTEPS):
            creep(
                agent, pose, *target, self.tool.table, self.block.table, SLOP, LOW_WALL, HIGH_WALL
            )
        return np.stack([agent, pose])

    @property
    def _given(self) -> tuple[Any, ...]:
        tables = self.tool.table, self.block.table
        return self.angle, *tables, REACH * PIXEL, SLOP, FAR * PIXEL


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
        room, limits = Room(DISK), PushLimits()
        start, heading = strokes(scenes, pushes, limits, T.bodies)
        ends = pixels(np.stack([start, start + pushes[:, LENGTH, None] * unit(heading)]))
        possible = room.contains(ends).all(axis=0) & (pushes[:, LENGTH] > 0.0)
        rows = zip(scenes, pushes, ends.swapaxes(0, 1), possible, strict=True)
        return np.array([self._push(*row) if can else row[0] for *row, can in rows])

    def _push(self, scene: np.ndarray, push: np.ndarray, ends: np.ndarray) -> np.ndarray:
        start, end = ends
        motion = np.array([start, LANDING * direction(start, end)])
        places = self._servo.stroke(start, end, push[SPEED] / PIXEL)
        targets = self._servo.targets(motion, places, {len(places) - 1: np.zeros(2)})
        env, pose = self._env, T.pose_of(scene)
        env._setup()
        env.block.angle = float(pose[2])
        env.block.position = tuple(pose[:2].tolist())
        env.agent.position = tuple(start.tolist())
        for velocity in self._servo.follow(motion, targets)[:, 1].tolist():
            env.agent.velocity = tuple(velocity)
            env.space.step(env.dt)
        return T.scene_of(np.array([*env.block.position, env.block.angle]), scene[0, MASS])


def load(name: str) -> Model:
    """Return the model of this name; the entry points in `pyproject.toml` lead here."""
    return Oracle() if name == "pusht_oracle" else Contacts()
