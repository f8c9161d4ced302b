"""gym-pusht as a world: strokes of its agent disk, and what they lead to."""

from typing import Any, Final

import numpy as np

from sain_core.errors import ConfigError
from sain_core.push import LENGTH, SPEED, strokes
from sain_core.scene import unit
from sain_core.shapes.bodies import Bodies
from sain_core.types import PushArray, Scene
from sain_core.world import Outcome
from sain_eval.loop.closed_loop import EpisodeOutcome, play_goals
from sain_mppi.agent.agent import Agent
from sain_pusht.agent import AGENT_RADIUS, FEASIBILITY, LIMITS, WALLS, ToolPlace
from sain_pusht.block import PIXEL, SIZE, Pose, goal_of, metres, pixels, pusht_bodies, scene_of
from sain_pusht.motion import (
    KEEP_OFF,
    Arena,
    Corners,
    DiskStroke,
    Room,
    nearest_outside,
    plan_motion,
    servo_of,
)

NAME: Final = "gym_pusht/PushT-v0"
INSTALL: Final = "pip install gym-pusht gymnasium"
BLOCK: Final = pusht_bodies()
MOST_STEPS: Final = 300  # gym-pusht's own limit
NEAR: Final = 0.0008  # [m]: the agent goes on until gym-pusht itself counts a success
TURNED: Final = 0.008  # [rad]
OVERLAP: Final = 3e-4  # [m], of things that touch: gym-pusht's solver leaves a tenth of this
DIGITS: Final = 9  # of coverages: pymunk keeps shapes in a set, whose order changes the last ones
STILL: Final = 1e-4  # [m] and [rad], that a block moves by at most in a step once it rests
LONGEST_REST: Final = 10  # steps to wait for that
HURRY: Final = 2.0  # how far beyond a place its target is, so that the disk gets there soon

Moment = tuple[Scene, np.ndarray]


def make_env(steps: int) -> Any:
    """Return gym-pusht's environment as its authors made it, cut off after so many steps.

    Raises:
        ConfigError: it is not installed, or cannot be loaded.
    """
    try:
        import gymnasium
        import gym_pusht  # noqa: F401  # isort: skip  (registers the environment)
    except ImportError as error:
        raise ConfigError(f"gym-pusht cannot be imported ({error}); {INSTALL}") from error
    return gymnasium.make(NAME, max_episode_steps=steps)


class PushtWorld:
    """One episode after another of gym-pusht, in our units and frame.

    Attributes:
        scene: (1, 8), with the block as it is now.
        motion: where the disk is [m] and how fast it moves [m/s], (2, 2).
        steps: of control in this episode.
        free_steps: those of them without contact.
        coverage: largest share of the goal that the block covered so far, as gym-pusht counts it.
        over: whether the episode has ended.
        success: whether gym-pusht counts it as a success.
        tool: where the disk is, for `pusht_agent`.
        moved_before: how far [m] the block moved before the last stroke began, at its corners.
        moments: block (1, 8) and place of the disk (2,) after each step, where these are kept.
    """

    def __init__(self, bodies: Bodies = BLOCK) -> None:
        """Make the environment."""
        self.bodies = bodies
        self.env = make_env(MOST_STEPS)
        self.inner = inner = self.env.unwrapped
        reach = FEASIBILITY.reach
        room = Room(reach.low, reach.high)
        self.arena = Arena(servo_of(inner), room, Room(0.0, SIZE * PIXEL), AGENT_RADIUS)
        self.tool = ToolPlace()
        self.moments: list[Moment] | None = None

    def reset(self, seed: int) -> Scene:
        """Begin the episode of this seed; return its first scene (1, 8).

        Where block and disk or walls overlap at first, they part before anything else: steps that
        count.
        """
        _, info = self.env.reset(seed=seed)
        self.steps = self.free_steps = 0
        self.over = self.success = False
        self.coverage = self.moved_before = 0.0
        self.note(info)
        self._part()
        return self.scene

    def observe(self) -> Scene:
        """Return the scene (1, 8) as it is."""
        return self.scene

    def push(self, push: PushArray, *, seen: Scene | None = None) -> Outcome:
        """Carry out a push; it leads to the scene (1, 8) after it, or when the episode ended.

        Raises:
            UnreachableError: the disk cannot get to where the push starts; nothing has moved.
        """
        first = self.scene
        start, heading = strokes(first if seen is None else seen, push, LIMITS, self.bodies)
        stroke = DiskStroke(start, unit(heading), float(push[LENGTH]), float(push[SPEED]))
        targets, free = plan_motion(self.motion, stroke, self.outline, self.arena)
        before = self.outline
        for index, target in enumerate(targets):
            self._step(target)
            if index < free:
                self.free_steps += 1
                self.moved_before = float(np.hypot(*(self.outline - before).T).max())
            if self.over:
                return Outcome(first, self.scene)
        self._part()
        return Outcome(first, self.scene)

    @property
    def goal(self) -> Pose:
        """The pose (3,) of gym-pusht that the block should have."""
        return np.asarray(self.inner.goal_pose)

    @property
    def outline(self) -> Corners:
        """The block's corners (8, 2) [m]."""
        return self.bodies.shapes[0].placed(self.scene[0])

    def _part(self) -> None:
        """Let what overlaps part: the disk leaves the block, walls push the block out."""
        away = self.arena.radius + KEEP_OFF
        for _ in range(LONGEST_REST):
            outline, place = self.outline, self.motion[0]
            apart = self.arena.gaps(place[None], outline)[0] > -OVERLAP
            low, high = WALLS[0] - OVERLAP, WALLS[1] + OVERLAP
            inside = bool((outline >= low).all() and (outline <= high).all())
            if self.over or (apart and inside):
                return
            before = self.scene
            self._step(place + HURRY * (nearest_outside(place, outline, away) - place))
            if apart and np.abs(self.scene - before).max() < STILL:
                return

    def _step(self, target: np.ndarray) -> None:
        _, _, ended, cut, info = self.env.step(pixels(target))
        self.steps += 1
        self.note(info)
        if self.moments is not None:
            self.moments.append((self.scene, self.motion[0]))
        self.over, self.success = bool(ended or cut), bool(info["is_success"])

    def note(self, info: dict[str, Any]) -> None:
        """Take note of what the environment says after a step."""
        self.tool.place = metres(np.asarray(info["pos_agent"]))
        velocity = np.asarray(info["vel_agent"]) * [PIXEL, -PIXEL]
        self.motion = np.stack([self.tool.place, velocity])
        self.scene = scene_of(np.asarray(info["block_pose"]))
        self.coverage = max(self.coverage, round(float(info.get("coverage", 0.0)), DIGITS))


def play_pusht(seed: int, agent: Agent, world: PushtWorld) -> EpisodeOutcome:
    """Play the episode of a seed until gym-pusht ends it, or the agent stops."""
    world.reset(seed)
    goals = [goal_of(world.goal, NEAR, TURNED)]
    return play_goals(agent, world, goals, world.bodies, 0, lambda: world.over)
