"""gym-pusht as a world: strokes of its agent disk, and what they lead to."""

from typing import Any, Final

import numpy as np

from sain_core.push import LENGTH, PushLimits, strokes
from sain_core.scene import unit
from sain_core.shapes.bodies import Bodies
from sain_core.types import PushArray, Scene
from sain_core.world import Outcome
from sain_pusht.agent import AGENT_RADIUS, FEASIBILITY, LIMITS, WALLS, ToolPlace
from sain_pusht.block import PIXEL, SIZE, Pose, metres, pixels, pusht_bodies, scene_of
from sain_pusht.extra import make_env
from sain_pusht.motion import Arena, DiskStroke, Pace, plan_motion
from sain_pusht.servo import Motion, servo_of
from sain_pusht.way import Corners, Room, way_out

BLOCK: Final = pusht_bodies()
MOST_STEPS: Final = 300  # gym-pusht's own limit
OVERLAP: Final = 3e-4  # [m], of things that touch: gym-pusht's solver leaves a tenth of this
DIGITS: Final = 9  # of coverages: pymunk keeps shapes in a set, whose order changes the last ones
STILL: Final = 1e-4  # [m] and [rad], that a block moves by at most in a step once it rests
LONGEST_REST: Final = 10  # steps to wait for that
HURRY: Final = 2.0  # how far beyond a place its target is, so that the disk gets there soon


class PushtWorld:
    """One episode after another of gym-pusht, in our units and frame.

    Attributes:
        scene: (1, 8), with the block as it is now.
        steps: of control in this episode.
        free_steps: those of them without contact.
        coverage: of the goal by the block now, as gym-pusht counts it.
        best: the largest so far.
        over: whether the episode has ended.
        success: whether gym-pusht counts it as a success.
        tool: where the disk is, for `pusht_agent`.
        moved_before: how far [m] the block moved before the last stroke began, at its corners.
    """

    def __init__(
        self,
        limits: PushLimits = LIMITS,
        pace: Pace = Pace(),
        steps: int = MOST_STEPS,
        bodies: Bodies = BLOCK,
    ) -> None:
        """Make the environment; `limits` state where strokes start."""
        self.limits, self._pace = limits, pace
        self.bodies = bodies
        self.env = make_env(steps)
        self.inner = inner = self.env.unwrapped
        reach = FEASIBILITY.reach
        room = Room(reach.low, reach.high)
        self.arena = Arena(servo_of(inner), room, Room(0.0, SIZE * PIXEL), AGENT_RADIUS)
        self.tool = ToolPlace()
        self.frames: list[np.ndarray] | None = None

    def reset(self, seed: int) -> Scene:
        """Begin the episode of this seed; return its first scene (1, 8).

        Where block and disk or walls overlap at first, they part before anything else: steps that
        count.
        """
        _, info = self.env.reset(seed=seed)
        self.steps = self.free_steps = 0
        self.over = self.success = False
        self.coverage = self.best = self.moved_before = 0.0
        self._see(info)
        self._part()
        return self.scene

    @property
    def goal(self) -> Pose:
        """The pose (3,) of gym-pusht that the block should have."""
        return np.asarray(self.inner.goal_pose)

    @property
    def motion(self) -> Motion:
        """Where the disk is [m] and how fast it moves [m/s], (2, 2)."""
        return self._motion

    def observe(self) -> Scene:
        """Return the scene (1, 8) as it is."""
        return self.scene

    def push(self, push: PushArray, *, seen: Scene | None = None) -> Outcome:
        """Carry out a push (5,); it leads to the scene (1, 8) after it, or when the episode ended.

        Raises:
            UnreachableError: the disk cannot get to where the push starts; nothing has moved.
        """
        first = self.scene
        start, heading = strokes(first if seen is None else seen, push, self.limits, self.bodies)
        stroke = DiskStroke(start, unit(heading), float(push[LENGTH]))
        targets, free = plan_motion(self._motion, stroke, self.outline, self.arena, self._pace)
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
    def outline(self) -> Corners:
        """The block's corners (8, 2) [m]."""
        return self.bodies.shapes[0].placed(self.scene[0])

    def _part(self) -> None:
        """Let what overlaps part: the disk leaves the block, walls push the block out."""
        away = self.arena.radius + self._pace.keep_off
        for _ in range(LONGEST_REST):
            outline, place = self.outline, self._motion[0]
            apart = self.arena.gaps(place[None], outline)[0] > -OVERLAP
            low, high = WALLS[0] - OVERLAP, WALLS[1] + OVERLAP
            inside = bool((outline >= low).all() and (outline <= high).all())
            if self.over or (apart and inside):
                return
            before = self.scene
            self._step(place + HURRY * (way_out(place, outline, away) - place))
            if apart and np.abs(self.scene - before).max() < STILL:
                return

    def _step(self, target: np.ndarray) -> None:
        _, _, ended, cut, info = self.env.step(pixels(target))
        self.steps += 1
        if self.frames is not None:
            self.frames.append(self.env.render())
        self._see(info)
        self.best = max(self.best, self.coverage)
        self.over, self.success = bool(ended or cut), bool(info["is_success"])

    def _see(self, info: dict[str, Any]) -> None:
        velocity = np.asarray(info["vel_agent"]) * [PIXEL, -PIXEL]
        self.tool.place = metres(np.asarray(info["pos_agent"]))
        self._motion = np.stack([self.tool.place, velocity])
        self.scene = scene_of(np.asarray(info["block_pose"]))
        self.coverage = round(float(info.get("coverage", 0.0)), DIGITS)
