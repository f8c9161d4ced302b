"""One push: table, disks and arm, newly built, and their control steps."""

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from sain_core.config import Config, option
from sain_core.errors import BlockedError
from sain_core.feasibility import Feasibility
from sain_core.scene import Table
from sain_core.types import Scene
from sain_sim.arm.client import Client
from sain_sim.arm.kinematics import Joints, Kinematics
from sain_sim.arm.motion import MotionConfig
from sain_sim.arm.panda import Arm, ArmConfig, PandaModel
from sain_sim.world.bodies import BodyState
from sain_sim.world.outcome import Observer, Sample
from sain_sim.world.parameters import WorldParameters
from sain_sim.world.stage import Stage

GRAVITY: Final = 9.81  # [m/s^2]
CONTACT_BREAKING: Final = 0.001  # [m]; Bullet's 0.02 keeps contacts of rims that slid apart
STEPS_PER_LOOK: Final = 6  # between two tests whether the disks are settled


@dataclass(frozen=True)
class WorldConfig(Config):
    """How a world is simulated; `WorldParameters` states what is in it."""

    motion: MotionConfig = MotionConfig()
    arm: ArmConfig = ArmConfig()
    feasibility: Feasibility = Feasibility()
    full_motion: bool = option(
        False, "show the arm's ways out of contact too; they take simulated time"
    )
    max_settle_time: float = option(
        3.0, "longest wait for disks to settle", unit="s", minimum=0.1, maximum=60.0
    )

    @property
    def kinematics(self) -> Kinematics:
        """The arm's kinematics, its base below the table top."""
        return Kinematics(-self.feasibility.table.height, self.arm.tool_length)


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


Watches = tuple[Watch, ...]


class Origin(NamedTuple):
    """The state that a workcell is built from: of the disks, and the arm's joints (7,)."""

    states: list[BodyState]
    joints: Joints


class Workcell:
    """Built for one push; building takes about 2 ms.

    Bullet's contact solver and broad phase keep data from earlier steps. These can be neither read
    nor saved (`saveState` loses them, and last bits), so equal worlds would give different
    results. A new workcell has none.
    """

    def __init__(
        self,
        client: Client,
        model: PandaModel,
        config: WorldConfig,
        parameters: WorldParameters,
        origin: Origin,
        steps: int,
    ) -> None:
        """Empty the client and build everything in it.

        Args:
            client: the world's client, which is emptied.
            model: the arm's description.
            config: how the world is simulated.
            parameters: of the disks.
            origin: the state to start from.
            steps: earlier control steps, from which time is counted.
        """
        self.origin = origin
        self.steps = self._first_step = steps
        self._client = client
        self._config = config
        table: Table = config.feasibility.table
        client.resetSimulation()
        client.setGravity(*parameters.roughness.gravity(GRAVITY))
        client.setTimeStep(config.motion.time_step)
        client.setPhysicsEngineParameter(
            deterministicOverlappingPairs=1, contactBreakingThreshold=CONTACT_BREAKING
        )
        body = model.load(client, -table.height)
        self.arm = Arm(client, body, config.kinematics, model, config.motion.time_step)
        self.arm.place(origin.joints)
        self.stage = Stage(client, parameters, table, origin.states)
        self.arm.set_friction(self.stage.tool_friction)

    @property
    def now(self) -> Origin:
        """The present state, to build another workcell from."""
        if self.steps == self._first_step:
            return self.origin
        return Origin(self.stage.states(), self.arm.joint_states()[0])

    def _states(self) -> list[BodyState]:
        """Return the disks' states; before the first step, exactly those of the origin.

        Bullet normalises orientations again when it is given them, which changes last bits.
        """
        return self.origin.states if self.steps == self._first_step else self.stage.states()

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.steps * self._config.motion.time_step

    def observe(self) -> Scene:
        """Return the disks' states (N, 8)."""
        return self.stage.scene(self._states())

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

    def perform(self, route: Route, watches: Watches, pushed: int | None) -> None:
        """Push and wait until the disks are still; show the arm's ways through the air, if wished.

        The tool waits where the push ended. Its ways through the air are shown and not simulated:
        the disks end in the same bytes with and without them.

        Raises:
            BlockedError: at the step in which the tool touches another body than the pushed one;
                never without one.
        """
        if self._config.full_motion:
            self._show(np.concatenate([route.approach, route.lower]), "approach", watches)
        self.arm.place(route.stroke[0])
        self._follow(route.stroke, "push", watches, pushed)
        self.settle("settle", watches, pushed)
        if self._config.full_motion:
            self._show(route.lift, "lift", watches)
        self.arm.place(route.lift[-1])

    def settle(self, phase: str, watches: Watches, pushed: int | None) -> None:
        """Step until two tests in a row find the disks settled, or for the longest wait."""
        looks = 0
        longest = round(self._config.max_settle_time / self._config.motion.time_step)
        for step in range(1, longest + 1):
            self._step(phase, watches, pushed)
            if step % STEPS_PER_LOOK == 0:
                looks = looks + 1 if self.stage.still() else 0
                if looks == 2:
                    return

    def _follow(self, joints: Joints, phase: str, watches: Watches, pushed: int | None) -> None:
        for _ in self.arm.follow(joints):
            self._step(phase, watches, pushed)

    def _show(self, joints: Joints, phase: str, watches: Watches) -> None:
        """Let time pass and the watches see the arm along joints (T, 7), without simulating it."""
        speeds = np.diff(joints, axis=0) / self._config.motion.time_step
        for place, speed in zip(joints[1:], speeds, strict=True):
            self.steps += 1
            if due := self._due(watches):
                tip = self.arm.kinematics.tips(place)
                moved = {"joint_positions": place, "joint_velocities": speed}
                seen = replace(self.sample(phase), **moved, tool=tip, commanded_tool=tip)
                for watch in due:
                    watch.observer(seen)

    def _due(self, watches: Watches) -> list[Watch]:
        return [watch for watch in watches if self.steps % watch.every == 0]

    def _step(self, phase: str, watches: Watches, pushed: int | None) -> None:
        self.stage.before_step()
        if self.arm.spring is not None:
            self.arm.spring.pull()
        self._client.stepSimulation()
        self.steps += 1
        if pushed is not None:
            touched = self.stage.touched_by(self.arm.body, self.arm.stick, pushed)
            if touched is not None:
                raise BlockedError(
                    f"the tool would come to touch body {touched}; this push may touch only"
                    f" body {pushed}"
                )
        if watches and (due := self._due(watches)):
            sample = self.sample(phase)
            for watch in due:
                watch.observer(sample)
