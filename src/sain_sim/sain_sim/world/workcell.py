"""What a world asks of its engine: to build a scene, and to make control steps in it.

An engine is a `Simulation`; `sain_sim.world.engines` finds it by name. It builds a `Workcell` for
each push. How a push goes, who watches it and when it is refused is here, once for all engines.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from math import degrees, radians
from typing import Any, Final, NamedTuple, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_arm.planning.arm_config import MotionConfig
from sain_arm.planning.push_planner import PushPlan, PushPlanner
from sain_arm.planning.reach import reach_of
from sain_arm.robot.arm_model import ArmModel
from sain_arm.robot.robot import Joints, Robot, Vector, read_robot
from sain_core.config import Config, option
from sain_core.errors import BlockedError
from sain_core.feasibility import Feasibility, Reach
from sain_core.scene import DISK_HEIGHT, POSITION, SETTLED_SPEED, SETTLED_SPIN, VELOCITY
from sain_core.types import Mask, Scalars, Scene
from sain_core.world import ToppledError, check_possible
from sain_sim.world.engines import DEFAULT_ROBOT
from sain_sim.world.parameters import FOOT_RADIUS, WorldParameters
from sain_sim.world.roughness import QUIET

FREE_TOOL: Final = "free_tool"  # a robot without an arm
TIME_STEP: Final = 1 / 240  # [s], of control
GRAVITY: Final = 9.81  # [m/s^2]
SAG: Final = 0.0002  # [m], by which a flat bottom sinks into the table under its weight
FALLEN: Final = 0.03  # [m], below where the middle of a body stands: it has left the table
MOST_LEAN: Final = radians(3.0)  # [rad], of a body that stands
MOST_LIFT: Final = 0.003  # [m], of the middle of a body that stands, up or down
ASIDE: Final = 1.5  # [rad], of the first joint at home: hides no body; a UR5 leans away from them
SETTLING: Final = 3.0  # [s], longest wait for disks to settle
STEPS_PER_LOOK: Final = 6  # between two tests whether the disks are settled


@dataclass(frozen=True)
class WorldConfig(Config):
    """How a world is simulated; `WorldParameters` states what is in it."""

    robot: str = option(
        DEFAULT_ROBOT, "YAML file of the robot that pushes, or the name of a shipped one"
    )
    motion: MotionConfig = MotionConfig(tip_height=0.008, clearance=0.048)
    feasibility: Feasibility = Feasibility()
    wait_aside: bool = option(
        False, "move the arm beside its base after each push, so that a camera sees all bodies"
    )
    full_motion: bool = option(
        False, "show the arm's ways out of contact too; they take simulated time"
    )

    @cached_property
    def arm(self) -> Robot:
        """The robot that pushes.

        Raises:
            ConfigError: its file is not there, or wrong.
        """
        return read_robot(self.robot)

    def fitted(self, planner: PushPlanner) -> "WorldConfig":
        """Return the same with the tool of the planner's robot, and its reach if none is stated.

        Raises:
            UnreachableError: the robot can push nowhere.
        """
        feasibility = self.feasibility
        limits = replace(feasibility.limits, tool_radius=planner.robot.tool_radius)
        reach = feasibility.reach
        if reach == Reach():
            reach = reach_of(planner)
        return replace(self, feasibility=replace(feasibility, limits=limits, reach=reach))

    @property
    def rise(self) -> float:
        """From the tool's tip up to where it touches bodies, at half their height [m]."""
        return DISK_HEIGHT / 2 - self.motion.tip_height


Tip = Float[ndarray, "3"]  # of the tool [m], in the world


def steps_of(duration: float) -> int:
    """Return the control steps, at least one, that come nearest to a duration [s]."""
    return max(1, round(duration / TIME_STEP))


@dataclass(frozen=True)
class Sample:
    """The world at one control step.

    Attributes:
        time: simulated time [s]; it never goes back, not even at a reset.
        joint_positions: (J,) [rad].
        joint_velocities: (J,) [rad/s].
        tool: the place of the tip, (3,) [m].
        commanded_tool: the commanded place of the tip, (3,) [m].
        scene: the disks, (N, 8).
        phase: "approach", "push", "settle", "aside" or "rest".
    """

    time: float
    joint_positions: Vector
    joint_velocities: Vector
    tool: Tip
    commanded_tool: Tip
    scene: Scene
    phase: str


Observer = Callable[[Sample], None]


class Route(NamedTuple):
    """Joints (T, J) after each control step of every part of a push, before the arm moves."""

    approach: Joints  # shown and not simulated, as `aside`; without it the arm jumps
    stroke: Joints
    withdraw: Joints  # a little, off the body
    aside: Joints  # from there to where the arm waits

    @classmethod
    def of(cls, plan: PushPlan, approach: Joints) -> "Route":
        """Return the steps of a plan behind an approach."""
        joints = plan.stroke.sampled(TIME_STEP)
        end = steps_of(plan.pushing[1])
        return cls(approach, joints[: end + 1], joints[end:], joints[-1:])


class Watch(NamedTuple):
    """An observer, and the steps between two of its calls."""

    observer: Observer
    every: int


class CellState(NamedTuple):
    """The state that a workcell is built from.

    Attributes:
        states: of the bodies, as the engine has them.
        joints: of the arm, (J,) [rad].
    """

    states: Any
    joints: Vector


class ControlledArm(ABC):
    """A robot's arm in an engine. Each command holds for one control step."""

    def __init__(self, model: ArmModel) -> None:
        """Control an arm whose kinematics a model has."""
        self.model = model
        self.target = model.robot.home

    @abstractmethod
    def put(self, joints: Vector) -> None:
        """Set the joints to (J,) at once, at rest."""

    @abstractmethod
    def command(self, joints: list[float], speeds: list[float]) -> None:
        """Command positions of now (J) [rad], and speeds (J) that lead to the next ones."""

    @abstractmethod
    def joint_states(self) -> tuple[Vector, Vector]:
        """Return the joints' positions (J,) [rad] and speeds (J,) [rad/s]."""

    def place(self, joints: Vector) -> None:
        """Set the arm to joints (J,) at once, at rest, and hold it there."""
        self.put(joints)
        self.hold(joints)

    def hold(self, joints: Vector) -> None:
        """Command the arm to rest at joints (J,)."""
        self.command(joints.tolist(), [0.0] * len(joints))
        self.target = joints

    def follow(self, joints: Joints) -> Iterator[int]:
        """Command one step towards each of joints (T, J) after the first; the caller steps.

        The motors get the position of now and the speed that leads to the next: a feed-forward
        that leaves the gain only disturbances to undo.
        """
        speeds = np.diff(joints, axis=0) / TIME_STEP  # (T - 1, J)
        commands = zip(joints[:-1].tolist(), speeds.tolist(), strict=True)
        for step, command in enumerate(commands):
            self.command(*command)
            self.target = joints[step + 1]
            yield step
        self.hold(joints[-1])

    def tip(self) -> Tip:
        """Return where the hand holds the tool's tip, (3,) [m]."""
        return self.model.tip(self.joint_states()[0])

    def tool(self) -> Tip:
        """Return where the tool's tip is, (3,) [m]."""
        return self.tip()

    def commanded_tip(self) -> Tip:
        """Return where the tool's tip was last commanded to be, (3,) [m]."""
        return self.model.tip(self.target)


class Workcell(ABC):
    """Table, bodies and arm, newly built for one push, and their control steps.

    Attributes:
        origin: the state that it was built from.
        steps: control steps so far, earlier workcells of the world included.
        arm: the arm in it.
    """

    arm: ControlledArm

    def __init__(
        self, config: WorldConfig, parameters: WorldParameters, origin: CellState, steps: int
    ) -> None:
        """Begin at an origin after so many control steps."""
        self.origin, self._parameters = origin, parameters
        self.steps = self._first_step = steps
        self._config = config

    @abstractmethod
    def states(self) -> Any:
        """Return the bodies' states, as an origin has them."""

    @abstractmethod
    def scene(self, states: Any) -> Scene:
        """Return the scene (N, 8) of bodies in these states."""

    @abstractmethod
    def heights(self, states: Any) -> Scalars:
        """Return how high the middles of bodies in these states are, (N,) [m]."""

    @abstractmethod
    def leans(self, states: Any) -> Scalars:
        """Return how far bodies in these states are tipped out of the plane, (N,) [rad]."""

    @abstractmethod
    def advance(self) -> None:
        """Simulate one control step.

        Raises:
            DivergedError: the engine found no finite solution.
        """

    @abstractmethod
    def touched(self, pushed: int) -> int | None:
        """Return the first body but the pushed one that the tool touches, if any."""

    @abstractmethod
    def disturb(self, before: bytes) -> None:
        """Draw the noise of a push, by the bytes of what it begins with."""

    @property
    def unmoved(self) -> bool:
        """Whether no control step was made."""
        return self.steps == self._first_step

    @property
    def now(self) -> CellState:
        """The present state, to build another workcell from."""
        return self.origin if self.unmoved else CellState(self.states(), self.arm.joint_states()[0])

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.steps * TIME_STEP

    def observe(self) -> Scene:
        """Return the bodies' states (N, 8); before the first step, exactly those of the origin.

        An engine may normalise orientations that it is given, which changes last bits.
        """
        return self.scene(self.origin.states if self.unmoved else self.states())

    def fallen(self) -> Mask:
        """Return which bodies (N,) have left the table."""
        return self._lifts(self.states()) < -FALLEN

    def still(self) -> bool:
        """Return whether every body on the table is settled; fallen bodies do not count."""
        states = self.states()
        vx, vy, spin = self.scene(states)[:, VELOCITY].T
        slow = (np.hypot(vx, vy) < SETTLED_SPEED) & (np.abs(spin) < SETTLED_SPIN)
        return bool(np.all(slow | (self._lifts(states) < -FALLEN)))

    def _lifts(self, states: Any) -> Scalars:
        """Return how far the middles of bodies are above where they stand on the table, (N,)."""
        return np.asarray(self.heights(states) - self._parameters.tops / 2)

    def sample(self, phase: str) -> Sample:
        """Return the arm and the disks as they are."""
        positions, velocities = self.arm.joint_states()
        return Sample(
            time=self.time,
            joint_positions=positions,
            joint_velocities=velocities,
            tool=self.arm.tool(),
            commanded_tool=self.arm.commanded_tip(),
            scene=self.observe(),
            phase=phase,
        )

    def perform(self, route: Route, watch: Watch | None, pushed: int | None) -> None:
        """Push and wait until the disks are still; show the arm's ways through the air, if wished.

        The tool withdraws and waits beside the body. Its ways through the air are shown and not
        simulated: the bodies end in the same bytes with and without them.

        Raises:
            BlockedError: at the step in which the tool touches another body than the pushed one;
                never without one.
            DivergedError: as `advance`, or bodies end where they cannot be.
            ToppledError: a body on the table no longer stands upright on it.
        """
        if self._parameters.roughness.noise != QUIET:
            self.disturb(self.scene(self.origin.states).tobytes() + route.stroke.tobytes())
        if self._config.full_motion:
            self._show(route.approach, "approach", watch)
        self.arm.place(route.stroke[0])
        self._follow(route.stroke, "push", watch, pushed)
        self._follow(route.withdraw, "settle", watch, pushed)
        self.settle("settle", watch, pushed)
        check_possible(self.scene(self.origin.states), self.observe())
        self._check_upright()
        if self._config.full_motion:
            self._show(route.aside, "aside", watch)
        self.arm.place(route.aside[-1])

    def _check_upright(self) -> None:
        """Raise `ToppledError` unless all bodies stand; at the table's edge they may fall."""
        states = self.states()
        lean, lift = self.leans(states), self._lifts(states)
        tipped = (lean > MOST_LEAN) | (np.abs(lift) > MOST_LIFT)
        tipped &= self._config.feasibility.table.contains(self.scene(states)[:, POSITION])
        if tipped.any():
            body = int(np.argmax(tipped))
            raise ToppledError(
                f"the push tips over body {body} ({self._parameters.shapes[body]}): it leans by"
                f" {degrees(lean[body]):.0f} degrees, its middle is {1e3 * lift[body]:+.0f} mm"
                f" above where it stands; bodies of {1e3 * self._parameters.tops[body]:.0f} mm must"
                " stand upright"
            )

    def step(self, positions: Vector, velocities: Vector) -> None:
        """Make one control step towards positions (J,), with velocities (J,), whatever touches."""
        self.arm.command(positions.tolist(), velocities.tolist())
        self.arm.target = positions
        self._step("rest", None, None)

    def settle(self, phase: str, watch: Watch | None, pushed: int | None) -> None:
        """Step until two tests in a row find the disks settled, or for the longest wait."""
        looks = 0
        for step in range(1, steps_of(SETTLING) + 1):
            self._step(phase, watch, pushed)
            if step % STEPS_PER_LOOK == 0:
                looks = looks + 1 if self.still() else 0
                if looks == 2:
                    return

    def _follow(self, joints: Joints, phase: str, watch: Watch | None, pushed: int | None) -> None:
        for _ in self.arm.follow(joints):
            self._step(phase, watch, pushed)

    def _show(self, joints: Joints, phase: str, watch: Watch | None) -> None:
        """Let time pass and the watch see the arm along joints (T, 7), without simulating it."""
        speeds = np.diff(joints, axis=0) / TIME_STEP
        for place, speed in zip(joints[1:], speeds, strict=True):
            self.steps += 1
            if watch is not None and self.steps % watch.every == 0:
                tip = self.arm.model.tip(place)
                moved = {"joint_positions": place, "joint_velocities": speed}
                sample = replace(self.sample(phase), **moved, tool=tip, commanded_tool=tip)
                watch.observer(sample)

    def _step(self, phase: str, watch: Watch | None, pushed: int | None) -> None:
        self.advance()
        self.steps += 1
        if pushed is not None and (touched := self.touched(pushed)) is not None:
            raise BlockedError(
                f"the tool would come to touch body {touched}; this push may touch only"
                f" body {pushed}"
            )
        if watch is not None and self.steps % watch.every == 0:
            watch.observer(self.sample(phase))


def lean_of(turns: Float[ndarray, "N 2"]) -> Scalars:
    """Return the angles (N,) [rad] from the vertical by x and y of unit quaternions (N, 2)."""
    return np.asarray(2.0 * np.arcsin(np.minimum(np.hypot(*turns.T), 1.0)))


def support_drop(parameters: WorldParameters, body: int) -> float:
    """Return how far the middles of a body's supports are above its middle [m]."""
    sag = SAG if parameters.lies_flat else 0.0
    return FOOT_RADIUS - float(parameters.tops[body]) / 2 - sag


class Closeable(ABC):
    """Base of what holds a client: ``with`` closes it."""

    @abstractmethod
    def close(self) -> None:
        """Close what it holds; doing it twice is fine."""

    def __enter__(self) -> Self:
        """Return the object itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()


class Simulation(Closeable):
    """An engine at work for one world: it holds what is built once and not for each push."""

    def __init__(self, config: WorldConfig) -> None:
        """Start an engine for worlds of this configuration."""
        self.planner = PushPlanner(config.arm, config=config.motion)
        self.config = config.fitted(self.planner)
        self.home = config.arm.aside(ASIDE) if config.wait_aside else config.arm.home

    @abstractmethod
    def resting(self, scene: Scene, parameters: WorldParameters) -> Any:
        """Return the states of bodies that stand at rest where a scene (N, 8) has them.

        Raises:
            ConfigError: parameters that the engine cannot simulate.
        """

    @abstractmethod
    def build(self, parameters: WorldParameters, origin: CellState, steps: int) -> Workcell:
        """Build a workcell with these bodies, after so many earlier control steps."""
