"""stable-worldmodel's Push-T, with its factors of variation, as a world; and episodes in it."""

import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec, module_from_spec
from typing import Any, Final

import numpy as np
import shapely

from pusht.block import PIXEL, WALLS, Block, metres, pixels
from pusht.model import REACH, SLIM, Contacts, Presses
from pusht.motion import Hull, Servo, plan_motion
from pusht.press import PACE, SUBSTEPS, most_steps
from pusht.press import WAITS as RESTS
from pusht.sight import Eyes
from pusht.world import OVERLAP, DiskWorld
from sain_core.errors import ConfigError, UnreachableError
from sain_core.model import Model
from sain_core.push import LENGTH, PushLimits
from sain_core.scene import POSE, THETA, wrap_angle
from sain_core.world import DivergedError, Outcome
from sain_mppi.config import PlannerConfig, ProgressConfig

PACKAGE: Final = "stable_worldmodel"
INSTALL: Final = "pip install --no-deps stable-worldmodel==0.1.1 loguru==0.7.3"
DISK_SHAPE: Final = 0  # of the agent: "o"
STARTS: Final = ("agent.start_position", "block.start_position", "block.angle")  # its default
TURN: Final = np.pi / 9  # within which angles agree: its eval_state
MOST_STEPS: Final = 200  # twice those of its World
IN_A_STEP: Final = 1.0 - (1.0 - PACE) ** SUBSTEPS  # of the way to its target
WAITS: Final = 4  # steps in which the disk comes to rest
SPEED: Final = 0.24  # [m/s], of strokes: 30 px in a step
PLANNER: Final = PlannerConfig(
    speeds=(SPEED,),
    correction_speed=SPEED,
    samples=256,
    horizon=2,
    ahead=False,
    progress=ProgressConfig(stalled_after=2, give_up_after=4),
)


def make_env() -> Any:
    """Return stable-worldmodel's Push-T as its authors made it.

    Their package imports PyTorch and data sets wherever one begins. So only the modules of Push-T
    are loaded, in packages of these names that are otherwise empty. They ask for pymunk 7, and
    gym-pusht for an earlier one: the one method that has another name there gets its new one.

    Raises:
        ConfigError: it is not installed, or cannot be loaded.
    """
    try:
        import pymunk

        if PACKAGE not in sys.modules:
            _prepare_packages()
        if not hasattr(pymunk.Space, "on_collision"):
            pymunk.Space.on_collision = _on_collision
        return import_module(f"{PACKAGE}.envs.pusht.env").PushT()
    except ImportError as error:
        message = f"stable-worldmodel's Push-T cannot be imported ({error}); {INSTALL}"
        raise ConfigError(message) from error


def _prepare_packages() -> None:
    for name in (PACKAGE, f"{PACKAGE}.envs", f"{PACKAGE}.envs.pusht"):
        spec = find_spec(name)
        if spec is None:
            raise ImportError(f"no module named {name}")
        sys.modules[name] = module_from_spec(spec)
    sys.modules[PACKAGE].utils = import_module(f"{PACKAGE}.utils")


def _on_collision(space: Any, first: int, second: int, post_solve: Any) -> None:
    space.add_collision_handler(first, second).post_solve = post_solve


def factors() -> list[str]:
    """Return the names of all factors of variation."""
    return make_env().variation_space.names()


class VariedWorld(DiskWorld):
    """An episode of stable-worldmodel's Push-T with a disk, seen by its states.

    Attributes:
        success: the step at which the environment first stated success; 0: none yet.
    """

    name = "stable-worldmodel's Push-T"

    def __init__(self, env: Any, most: int) -> None:
        """Begin the episode to which an environment was reset."""
        self.env, self.most, self.success = env, most, 0
        self.servo = Servo.of(env, REACH)
        disk = next(iter(env.agent.shapes))
        super().__init__(Block.read("block", env.block), getattr(disk, "radius", 0.0))
        self._begin()
        self._part()
        self._come_out()

    @property
    def model(self) -> Model:
        """The model of this block and agent."""
        return Contacts(self.block, self.room.disk)

    @property
    def limits(self) -> PushLimits:
        """The limits of pushes by this agent."""
        return PushLimits(tool_radius=self.room.disk * PIXEL)

    def planner(self, tried: int) -> PlannerConfig:
        """Return the planner's settings for one try after another, from 0."""
        return replace(PLANNER, horizon=PLANNER.horizon + tried, samples=PLANNER.samples << tried)

    @property
    def goals(self) -> list[np.ndarray]:
        """The places of agent and block (5,) [px, rad] that are the goal, or may be."""
        return [self.env.goal_state[:5]]

    def gaps(self, agents: np.ndarray, outlines: np.ndarray) -> np.ndarray:
        """Return the gaps (B,) [px] of agents (B, 2) and blocks (B, M, 2)."""
        return shapely.distance(shapely.polygons(outlines), shapely.points(agents)) - self.room.disk

    def go(self, place: np.ndarray) -> None:
        """Bring the agent to a place (2,) [px], and let it rest there.

        Where the block is in the way, it is pushed in the last step of the path.
        """
        place = self._middle(place)
        outside = self.room.nearest_outside(place, shapely.Polygon(self._outline))
        for end in (place, outside):
            with suppress(UnreachableError):
                if not self._go_round(end):
                    return
                break
        self._press_on(place)

    def _middle(self, place: np.ndarray) -> np.ndarray:
        """Return where the agent's middle (2,) is if the agent is at a place (2,)."""
        return place

    def _go_round(self, end: np.ndarray) -> bool:
        """Bring the agent to a place, round the block; return whether the episode goes on."""
        motion, outline = self.motion, self._outline
        speed = SPEED / PIXEL
        return self._follow(plan_motion(self.servo, self.room, motion, end, end, speed, outline))

    def _press_on(self, place: np.ndarray) -> None:
        """Let the agent go on to a place, whatever is there."""
        self._follow(np.tile(place, (WAITS, 1)))

    def _step(self, target: np.ndarray) -> bool:
        """Move the agent for a step of control; return whether the episode goes on.

        The environment compares angles that may differ by more than a turn, and then states success
        for any. The episode goes on until the angles agree.
        """
        action = np.clip((target - self.motion[0]) / REACH, -1.0, 1.0)
        _, _, success, _, _ = self.env.step(action.astype(np.float32))
        self.steps += 1
        if success and not self.success:
            self.success = self.steps
        turn = wrap_angle(self.env.block.angle - self.env.goal_state[4])
        self.done = bool(success) and abs(turn) < TURN
        self._look(action)
        return not self.done and self.steps < self.most

    def _begin(self) -> None:
        """See the episode's first scene."""
        self._note()

    def _look(self, action: np.ndarray) -> None:
        """See what an action (2,) led to."""
        self._note()


class SlowWorld(VariedWorld):
    """An episode with an agent that is no disk.

    Such an agent has a mass, creeps, and turns when it touches the block.
    """

    def __init__(self, env: Any, most: int) -> None:
        """Begin the episode to which an environment was reset."""
        self.tool = Block.read("agent", env.agent)
        self._presses = Presses(Block.read("block", env.block), self.tool)
        super().__init__(env, most)

    @property
    def model(self) -> Model:
        """The model of this block and agent, at the angle that the agent has."""
        return self._presses

    @property
    def limits(self) -> PushLimits:
        """The limits of pushes by this agent."""
        return SLIM

    def planner(self, tried: int) -> PlannerConfig:
        """Return the planner's settings: few samples, as each takes a millisecond."""
        return replace(PLANNER, horizon=1, samples=96, beam=96)

    @property
    def motion(self) -> np.ndarray:
        """The place (2,) [px] of the agent's centroid, and no velocity."""
        return np.stack([pixels(self._agent[0, :2]), np.zeros(2)])

    def gaps(self, agents: np.ndarray, outlines: np.ndarray) -> np.ndarray:
        """Return the gaps (B,) [px] of agents (B, 2) and blocks (B, M, 2); overlaps are below 0."""
        own = pixels(self.tool.shape.placed(self._agent[0])) - self.motion[0]
        centres = np.array([self._middle(agent) for agent in agents])
        one, other = shapely.polygons(own + centres[:, None]), shapely.polygons(outlines)
        shared = shapely.area(shapely.intersection(one, other))
        return np.where(shared > 0.0, -np.sqrt(shared), shapely.distance(one, other))

    def push(self, push: np.ndarray, *, seen: np.ndarray | None = None) -> Outcome:
        """Execute a push, or as much of it as there are steps.

        Raises:
            UnreachableError: the agent cannot get to where the push starts; nothing has moved.
            DivergedError: no steps are left.
        """
        before, timed = self.observe(), self.steps
        if self.done or self.steps >= self.most:
            raise DivergedError(f"{self.name} ends an episode after {self.most} steps")
        start, way = self._presses.start(before if seen is None else seen, push)
        start, way = pixels(start), way / PIXEL * [1.0, -1.0]
        if not self.room.contains(start):
            raise UnreachableError(f"the agent would go into a wall of {self.name}")
        if self._go_round(start) and push[LENGTH] > 0.0:
            self._stroke(way)
        return Outcome(before, self.observe(), (self.steps - timed) * self.servo.period)

    def _stroke(self, way: np.ndarray) -> None:
        """Press on by a way (2,) [px], as `press.stroke` does."""
        length, begun = float(np.hypot(*way)), self.motion[0]
        along = way / max(length, 1e-9)
        drive = along * REACH / np.abs(along).max()
        for _ in range(most_steps(length, float(np.hypot(*drive)))):
            if (self.motion[0] - begun) @ along >= length:
                break
            if not self._step(self.motion[0] + drive):
                return
        for _ in range(RESTS):
            if not self._step(self.motion[0]):
                return

    def _middle(self, place: np.ndarray) -> np.ndarray:
        pose = np.append(place, -self._agent[0, THETA])
        return pixels(self.tool.scene_of(pose)[0, :2])

    def _go_round(self, end: np.ndarray) -> bool:
        for place in self.room.path(self.motion[0], end, shapely.Polygon(self._outline)):
            here = self.motion[0]
            if not self._step(here + (place - here) / IN_A_STEP):
                return False
        return True

    def _press_on(self, place: np.ndarray) -> None:
        for _ in range(2 * WAITS):
            here = self.motion[0]
            if not self._step(here + (place - here) / IN_A_STEP):
                return

    def _part(self) -> None:
        """Let agent and block part, which overlap at first, and walls push the block out."""
        for _ in range(WAITS):
            apart = self.gaps(self._origin[None], self._outline[None])[0] > -2.0
            outline = self._outline
            inside = (outline >= WALLS[0] - OVERLAP) & (outline <= WALLS[1] + OVERLAP)
            if (apart and inside.all()) or not self._step(self.motion[0]):
                return

    def _come_out(self) -> None:
        """Do nothing: pushes are only those to which there is a path."""

    @property
    def _origin(self) -> np.ndarray:
        return self.tool.pose_of(self._agent)[:2]

    def _note(self) -> None:
        super()._note()
        pose = [*self.env.agent.position, self.env.agent.angle]
        self._turn(self.tool.scene_of(np.array(pose)))

    def _turn(self, agent: np.ndarray) -> None:
        """Take note of the agent's scene (1, 8), and of where it then can be."""
        self._agent = agent
        own = agent[0].copy()
        cos, sin = np.cos(own[THETA]), np.sin(own[THETA])
        turn = np.array([[cos, sin], [-sin, cos]]) / PIXEL * [1.0, -1.0]
        parts = tuple(part @ turn for part in self.tool.shape.parts(self.tool.radius))
        self.room = Hull(0.0, parts)
        presses = self._presses
        presses.angle, presses.room, presses.place = float(own[THETA]), self.room, pixels(own[:2])


class Pictures(VariedWorld):
    """What sees an episode by its pictures, and by no state.

    Outlines, mass and inertia are given, as is where a motion that is asked for leads the agent.
    """

    @property
    def motion(self) -> np.ndarray:
        """The place and the velocity (2, 2) [px, px/s] of the agent, as seen."""
        return self._motion.copy()

    @property
    def goals(self) -> list[np.ndarray]:
        """The places of agent and block that the goal's picture may show.

        A block that looks the same after a turn may have to be turned further.
        """
        turns = round(2 * np.pi / self.block.symmetry)
        goals = []
        for turn in range(turns):
            scene = self._goal[1].copy()
            scene[0, THETA] = wrap_angle(scene[0, THETA] + turn * self.block.symmetry)
            goals.append(np.append(self._goal[0], self.block.pose_of(scene)))
        ahead = [abs(wrap_angle(goal[4] - self.block.pose_of(self._scene)[2])) for goal in goals]
        return [goals[place] for place in np.argsort(ahead)]

    def _begin(self) -> None:
        first, goal = self.env.render(), self.env._goal
        self._eyes = Eyes.learned([first, goal], *self._outlines)
        agent, block = self._eyes.look(goal)
        self._goal = self._place_of(agent.pose), self.block.scene_at(block.pose)
        agent, block = self._eyes.look(first)
        self._motion = np.stack([agent.pose[:2], np.zeros(2)])
        self._scene = self.block.scene_at(block.pose)

    @property
    def _outlines(self) -> tuple[np.ndarray, np.ndarray, bool]:
        """The outlines (M, 2) [px] of agent and block, and whether the agent's is a circle."""
        bearings = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
        disk = self.room.disk * np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)
        return disk, self.block.outline, True

    def _place_of(self, pose: np.ndarray) -> np.ndarray:
        """Return the agent's place (2,) where its centroid and angle (3,) are seen."""
        return pose[:2]

    def _look(self, action: np.ndarray) -> None:
        before = self._motion
        expected = self.servo.follow(before, (before[0] + REACH * action)[None])[-1]
        way = PIXEL * (expected[0] - before[0]) * [1.0, -1.0]
        moved = self.model.moved(self._scene[0][None], metres(before[0])[None], way[None])
        agent, block = self._eyes.look(self.env.render(), -moved[0, 2])
        self._motion = np.stack([agent.pose[:2] if agent.share > 0.0 else expected[0], expected[1]])
        if block.share > 0.0:
            self._scene = self.block.scene_at(block.pose)


class PictureWorld(Pictures):
    """An episode with a disk, seen by its pictures."""


class SlowPictureWorld(Pictures, SlowWorld):
    """An episode with an agent that is no disk, seen by its pictures."""

    @property
    def _outlines(self) -> tuple[np.ndarray, np.ndarray, bool]:
        return self.tool.outline, self.block.outline, False

    def _place_of(self, pose: np.ndarray) -> np.ndarray:
        return self.tool.pose_of(self.tool.scene_at(pose))[:2]

    def _begin(self) -> None:
        super()._begin()
        agent, _ = self._eyes.look(self.env.render())
        self._turn(self.tool.scene_at(agent.pose))

    def _look(self, action: np.ndarray) -> None:
        here = self._agent[0]
        target = here[:2] + REACH * PIXEL * action * [1.0, -1.0]
        expected = self._presses.follow(here[POSE], self._scene[0], target)
        agent, block = self._eyes.look(self.env.render(), -expected[1, 2], -expected[0, 2])
        if agent.share > 0.0:
            self._turn(self.tool.scene_at(agent.pose))
        if block.share > 0.0:
            self._scene = self.block.scene_at(block.pose)
        self._motion = SlowWorld.motion.fget(self)


def begin_episode(
    varied: Sequence[str], seed: int, pictures: bool = False, most: int = MOST_STEPS
) -> VariedWorld:
    """Begin the episode of a seed in which some factors are drawn, seen by states or pictures."""
    env = make_env()
    env.reset(seed=seed, options={"variation": list(varied)})
    disk = env.variation_space["agent"]["shape"].value == DISK_SHAPE
    kinds = (SlowWorld, SlowPictureWorld), (VariedWorld, PictureWorld)
    return kinds[int(disk)][int(pictures)](env, most)
