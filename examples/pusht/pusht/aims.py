"""An agent's episode in stable-worldmodel's Push-T: the poses that it aims at, and how it plays."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from pusht.block import WALLS, Block, pixels
from pusht.varied import TURN, VariedWorld
from sain_core.feasibility import Feasibility
from sain_core.goal import BodyPose, Goal, Judgement
from sain_core.scene import THETA, Table, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_eval.loop.play import play
from sain_mppi.agent.agent import AgentConfig, planning_agent

NEAR: Final = 20.0  # [px], over places of agent and block: stable-worldmodel's eval_state
SHARES: Final = (0.75, 0.5, 0.25)  # of what is allowed, within which the block is brought, in turn
MOST_PUSHES: Final = 60  # of one try
DRAWN: Final = 8000  # poses near a goal
GAP: Final = 1.0  # [px], between agent and block at the end
LEAST: Final = 0.1  # more than the least that is possible


@dataclass(frozen=True)
class Aim:
    """Where agent and block are to come to."""

    wanted: np.ndarray  # (5,), the goal
    agent: np.ndarray  # (2,) [px], near it, and so that nothing overlaps
    pose: np.ndarray  # (3,) of the block, likewise

    @classmethod
    def of(cls, wanted: np.ndarray, world: VariedWorld, random: np.random.Generator) -> "Aim":
        """Return the poses nearest to a goal (5,) in which agent, block and walls do not overlap.

        They are the best of many drawn ones.
        """
        apart = random.normal(size=(DRAWN, 4))
        apart *= NEAR * (random.random(DRAWN) / np.linalg.norm(apart, axis=1))[:, None]
        apart[:, :2] *= random.random((DRAWN, 1)) < 0.8
        turns = TURN * random.uniform(-1.0, 1.0, DRAWN)
        turns[: DRAWN // 4] = 0.0
        apart[0] = 0.0
        off = np.maximum(np.linalg.norm(apart, axis=1) / NEAR, np.abs(turns) / TURN)
        order = np.argsort(off, kind="stable")
        poses = wanted + np.column_stack([apart, turns])[order]
        outline = pixels(world.block.shape.placed(world.block.scene_of(wanted[2:])[0]))
        arms = outline - wanted[2:4]
        cos, sin = np.cos(poses[:, 4] - wanted[4]), np.sin(poses[:, 4] - wanted[4])
        turned = np.einsum(
            "dij,mj->dmi", np.array([[cos, -sin], [sin, cos]]).transpose(2, 0, 1), arms
        )
        outlines = turned + poses[:, None, 2:4]
        free = world.gaps(poses[:, :2], outlines) - GAP
        walls = np.minimum(outlines - WALLS[0], WALLS[1] - outlines).min(axis=(1, 2))
        worst = np.minimum(np.minimum(free, walls), 0.0)
        best = int(np.argmax(worst))  # the first in which nothing overlaps, or all least
        return cls(wanted, poses[best, :2], np.append(poses[best, 2:4], wrap_angle(poses[best, 4])))

    def off(self, pose: np.ndarray) -> float:
        """Return how far off the goal all is with the block at a pose (3,), over what may be."""
        apart = np.linalg.norm(np.append(self.agent, pose[:2]) - self.wanted[:4])
        return max(float(apart) / NEAR, abs(float(wrap_angle(pose[2] - self.wanted[4]))) / TURN)


@dataclass(frozen=True, eq=False)
class NearGoal(Judgement):
    """Judges by how far off agent and block would be."""

    off: float = 0.0
    share: float = 1.0

    @property
    def missed(self) -> tuple[int, ...]:
        """The number of the pose, unless it is near enough."""
        return () if self.off <= self.share else (0,)


@dataclass(frozen=True)
class AimGoal(Goal):
    """A pose that is reached within a share of what the environment allows."""

    aim: Aim | None = None
    block: Block | None = None
    share: float = 1.0

    def judge(
        self, scene: np.ndarray, start: np.ndarray, bodies: Bodies, table: Table = Table()
    ) -> NearGoal:
        """Judge a scene (1, 8)."""
        plain = super().judge(scene, start, bodies, table)
        off = self.aim.off(self.block.pose_of(scene))
        return NearGoal(**vars(plain), off=off, share=self.share)


def play_episode(world: VariedWorld, seed: int = 0) -> None:
    """Let the agent play an episode to its end."""
    random = np.random.default_rng(seed)
    model, feasibility = world.model, Feasibility(limits=world.limits)
    aims = [Aim.of(goal, world, random) for goal in world.goals]
    for tried, share in enumerate(SHARES):
        wider = world.planner(tried)
        config = AgentConfig(planner=wider, feasibility=feasibility, seed=seed)
        for aim in aims:
            x, y, heading = world.block.scene_of(aim.pose)[0, : THETA + 1].tolist()
            within = max(share, aim.off(aim.pose) + LEAST)
            goal = AimGoal(
                (BodyPose(0, x, y, heading),), (), aim=aim, block=world.block, share=within
            )
            agent = planning_agent(model, model, config)
            play(agent, world, [goal], world.block.bodies, MOST_PUSHES)
            if not world.done and world.steps < world.most:
                world.go(aim.agent)
            if world.done or world.steps >= world.most:
                return
