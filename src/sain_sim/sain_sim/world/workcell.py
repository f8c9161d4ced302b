"""What a world asks of its engine: to build a scene, and to make control steps in it.

An engine is a `Simulation`; `sain_sim.world.engines` finds it by name. It builds a `Workcell` for
each push. How a push goes, who watches it and when it is refused is here, once for all engines.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import degrees, radians
from typing import Any, Final, NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_arm.planning.arm_config import MotionConfig
from sain_core.config import Config, option
from sain_core.errors import BlockedError
from sain_core.feasibility import Feasibility
from sain_core.scene import DISK_HEIGHT, POSITION, SETTLED_SPEED, SETTLED_SPIN, VELOCITY
from sain_core.types import Mask, Scalars, Scene
from sain_core.world import ToppledError, check_possible
from sain_sim.arm.client import Closeable
from sain_sim.arm.motion import TIME_STEP, ControlledArm, Joints, Kinematics
from sain_sim.world.parameters import FOOT_RADIUS, WorldParameters
from sain_sim.world.roughness import QUIET

GRAVITY: Final = 9.81  # [m/s^2]
SAG: Final = 0.0002  # [m], by which a flat bottom sinks into the table under its weight
FALLEN_HEIGHT: Final = -0.01  # [m], a body whose middle is lower has left the table
MOST_LEAN: Final = radians(3.0)  # [rad], of a body that stands
MOST_LIFT: Final = 0.003  # [m], of the middle of a body that stands, up or down
ASIDE: Final = (0.03, -0.35)  # [m], above where it hides no body from a camera in front of it
HOME: Final = (0.35, 0.0)  # [m], above where the tool waits for the first push
SETTLING: Final = 3.0  # [s], longest wait for disks to settle
STEPS_PER_LOOK: Final = 6  # between two tests whether the disks are settled


@dataclass(frozen=True)
class WorldConfig(Config):
    """How a world is simulated; `WorldParameters` states what is in it."""

    motion: MotionConfig = MotionConfig(tip_height=0.008, clearance=0.048)
    feasibility: Feasibility = Feasibility()
    wait_aside: bool = option(
        False, "move the arm beside its base after each push, so that a camera sees all bodies"
    )
    full_motion: bool = option(
        False, "show the arm's ways out of contact too; they take simulated time"
    )

    @property
    def kinematics(self) -> Kinematics:
        """The arm's kinematics, its base below the table top."""
        return Kinematics(-self.feasibility.table.height)


def steps_of(duration: float) -> int:
    """Return the control steps, at least one, that come nearest to a duration [s]."""
    return max(1, round(duration / TIME_STEP))


@dataclass(frozen=True)
class Sample:
    """The world at one control step.

    Attributes:
        time: simulated time [s]; it never goes back, not even at a reset.
        joint_positions: (7,) [rad].
        joint_velocities: (7,) [rad/s].
        tool: the place of the tip, (3,) [m].
        commanded_tool: the commanded place of the tip, (3,) [m].
        scene: the disks, (N, 8).
        phase: "approach", "push", "settle", "lift" or "rest".
    """

    time: float
    joint_positions: Float[ndarray, "7"]
    joint_velocities: Float[ndarray, "7"]
    tool: Float[ndarray, "3"]
    commanded_tool: Float[ndarray, "3"]
    scene: Scene
    phase: str


Observer = Callable[[Sample], None]


class Route(NamedTuple):
    """Joint angles (T, 7) of every part of a push, computed before the arm moves."""

    approach: Joints
    lower: Joints
    stroke: Joints
    lift: Joints


class Watch(NamedTuple):
    """An observer, and the steps between two of its calls."""

    observer: Observer
    every: int


class CellState(NamedTuple):
    """The state that a workcell is built from.

    Attributes:
        states: of the bodies, as the engine has them.
        joints: of the arm, (7,) [rad].
    """

    states: Any
    joints: Joints


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
        return self.heights(self.states()) < FALLEN_HEIGHT

    def still(self) -> bool:
        """Return whether every body on the table is settled; fallen bodies do not count."""
        states = self.states()
        vx, vy, spin = self.scene(states)[:, VELOCITY].T
        slow = (np.hypot(vx, vy) < SETTLED_SPEED) & (np.abs(spin) < SETTLED_SPIN)
        return bool(np.all(slow | (self.heights(states) < FALLEN_HEIGHT)))

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

        The tool waits where the push ended. Its ways through the air are shown and not simulated:
        the disks end in the same bytes with and without them.

        Raises:
            BlockedError: at the step in which the tool touches another body than the pushed one;
                never without one.
            DivergedError: as `advance`, or bodies end where they cannot be.
            ToppledError: a body on the table no longer stands upright on it.
        """
        if self._parameters.roughness.noise != QUIET:
            self.disturb(self.scene(self.origin.states).tobytes() + route.stroke.tobytes())
        if self._config.full_motion:
            self._show(np.concatenate([route.approach, route.lower]), "approach", watch)
        self.arm.place(route.stroke[0])
        self._follow(route.stroke, "push", watch, pushed)
        self.settle("settle", watch, pushed)
        check_possible(self.scene(self.origin.states), self.observe())
        self._check_upright()
        if self._config.full_motion:
            self._show(route.lift, "lift", watch)
        self.arm.place(route.lift[-1])

    def _check_upright(self) -> None:
        """Raise `ToppledError` unless all bodies stand; at the table's edge they may fall."""
        states = self.states()
        lean, height = self.leans(states), self.heights(states)
        tipped = (lean > MOST_LEAN) | (np.abs(height - DISK_HEIGHT / 2) > MOST_LIFT)
        tipped &= self._config.feasibility.table.contains(self.scene(states)[:, POSITION])
        if tipped.any():
            body = int(np.argmax(tipped))
            raise ToppledError(
                f"the push tips over body {body} ({self._parameters.shapes[body]}): it leans by"
                f" {degrees(lean[body]):.0f} degrees, its middle is {1e3 * height[body]:.0f} mm"
                f" high; bodies must stand upright, their middles {1e3 * DISK_HEIGHT / 2:.0f} mm"
                " high"
            )

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
                tip = self.arm.kinematics.tips(place)
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


def support_drop(parameters: WorldParameters) -> float:
    """Return how far the middles of supports are above that of their body [m]."""
    sag = SAG if parameters.lies_flat else 0.0
    return FOOT_RADIUS - DISK_HEIGHT / 2 - sag


class Simulation(Closeable):
    """An engine at work for one world: it holds what is built once and not for each push."""

    def __init__(self, config: WorldConfig) -> None:
        """Start an engine for worlds of this configuration."""
        self.config = config
        place = ASIDE if config.wait_aside else HOME
        self.home = config.kinematics.joints(np.array([*place, config.motion.raised]))

    @abstractmethod
    def resting(self, scene: Scene, parameters: WorldParameters) -> Any:
        """Return the states of bodies that stand at rest where a scene (N, 8) has them.

        Raises:
            ConfigError: parameters that the engine cannot simulate.
        """

    @abstractmethod
    def build(self, parameters: WorldParameters, origin: CellState, steps: int) -> Workcell:
        """Build a workcell with these bodies, after so many earlier control steps."""
