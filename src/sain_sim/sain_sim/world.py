"""The simulated world: a table, disks, and a Panda that pushes the mid disk with its stick."""

from dataclasses import dataclass
from types import TracebackType
from typing import Final, NamedTuple, Self

import numpy as np

from sain_core.config import Config, option
from sain_core.errors import BlockedError, StaleSceneError
from sain_core.feasibility import Feasibility
from sain_core.scene import Table, check_on_table, check_scene
from sain_core.types import PushArray, Scene
from sain_sim.arm import STICK_LINK, Arm, ArmConfig, PandaModel
from sain_sim.client import Client
from sain_sim.disks import BodyState, resting
from sain_sim.kinematics import Joints, Kinematics
from sain_sim.motion import MotionConfig
from sain_sim.outcome import Observer, PushOutcome, Sample, Stroke, is_idle
from sain_sim.refusals import check_gap, check_reach, check_same_disks
from sain_sim.parameters import WorldParameters
from sain_sim.stage import Stage

GRAVITY: Final = 9.81  # [m/s^2]
HOME: Final = (0.35, 0.0)  # [m], where the tool waits before the first push
STEPS_PER_LOOK: Final = 6  # between two looks whether the disks are still


@dataclass(frozen=True)
class WorldConfig(Config):
    """How a world is run; what is in it is in `WorldParameters`."""

    motion: MotionConfig = MotionConfig()
    arm: ArmConfig = ArmConfig()
    feasibility: Feasibility = Feasibility()
    full_motion: bool = option(
        False, "move the arm also out of contact, instead of setting it to where it would get"
    )
    max_settle_time: float = option(
        3.0, "longest wait for disks to settle", unit="s", minimum=0.1, maximum=60.0
    )


class Route(NamedTuple):
    """Joint angles (T, 7) of every part of a push; made before anything moves."""

    approach: Joints
    lower: Joints
    stroke: Joints
    lift: Joints


class Watch(NamedTuple):
    """Someone who looks at the world, each so many steps."""

    observer: Observer
    every: int


class World:
    """One PyBullet world of its own. Two worlds never touch each other.

    Its state is the poses and velocities of its bodies. What Bullet's contact solver and broad
    phase remember is no part of it: it can be neither seen nor saved, and made worlds differ
    that should not. So each push starts in a world built anew from that state, in about 2 ms:
    the same state and push give the same bytes, in whichever world they meet.
    """

    def __init__(self, parameters: WorldParameters, config: WorldConfig = WorldConfig()) -> None:
        """Start with the disks in a row; `reset` puts them where they belong."""
        self.config = config
        self.parameters = parameters
        self._steps = 0
        limits, table = config.feasibility.limits, config.feasibility.table
        self._model = PandaModel(limits.tool_radius, config.arm.tool_length)
        self._kinematics = Kinematics(-table.height, config.arm.tool_length)
        self._home = self._kinematics.joints(np.array([*HOME, config.motion.raised]))
        self._client = Client()
        self._reset(_side_by_side(parameters, table))

    def reset(self, scene: Scene, parameters: WorldParameters | None = None) -> Scene:
        """Put the disks where a scene (N, 8) has them, at rest, and the arm at home.

        Args:
            scene: poses to take; its masses and radii must be those of the parameters.
            parameters: a new set of disks; without it the disks stay the ones they are.

        Returns:
            The scene as observed, which is the one asked for with zero velocities.

        Raises:
            InvalidInputError: not a scene, or one of other disks than these.
            OffTableError: a disk off the table.
        """
        parameters = parameters or self.parameters
        check_scene(scene, self.config.feasibility.table)
        check_same_disks(scene, parameters)
        self.parameters = parameters
        self._reset(scene)
        return self.observe()

    def _reset(self, scene: Scene) -> None:
        self._build([resting(self._client, state) for state in scene], self._home)

    def _build(self, states: list[BodyState], joints: Joints) -> None:
        client, config = self._client, self.config
        client.resetSimulation()
        client.setGravity(0.0, 0.0, -GRAVITY)
        client.setTimeStep(config.motion.time_step)
        client.setPhysicsEngineParameter(deterministicOverlappingPairs=1)
        body = self._model.load(client, self._kinematics.base_height)
        self._arm = Arm(client, body, self._kinematics, config.arm, config.motion.time_step)
        self._arm.place(joints)
        self._stage = Stage(client, self.parameters, config.feasibility.table, states)
        self._arm.set_friction(self._stage.tool_friction)

    @property
    def time(self) -> float:
        """Simulated time [s] since the world was made; it goes on over resets."""
        return self._steps * self.config.motion.time_step

    def observe(self) -> Scene:
        """Return the disks' states (N, 8) as they are."""
        return self._stage.observe()

    def sample(self, phase: str = "rest") -> Sample:
        """Return all there is to see of the world as it is."""
        positions, velocities = self._arm.joint_states()
        return Sample(
            time=self.time,
            joint_positions=positions,
            joint_velocities=velocities,
            tool=self._arm.kinematics.tips(positions),
            commanded_tool=self._arm.commanded_tip(),
            scene=self.observe(),
            phase=phase,
        )

    def check(self, push: PushArray) -> Stroke:
        """Return the tool's way for a push (3,) that can be carried out from here.

        A disk that gets shoved into the tool's way shows only when it happens: `push` looks.

        Raises:
            InvalidInputError: wrong shape, NaN or Inf.
            OutOfRangeError: a value outside its range.
            OffTableError: a disk has left the table.
            StaleSceneError: the disks still move; `settle` waits for them.
            UnreachableError: a pose on the way, with the reason.
            BlockedError: another disk is in the tool's way.
        """
        feasibility = self.config.feasibility
        feasibility.limits.check(push)
        scene = self.observe()
        check_on_table(scene, feasibility.table)
        if not self._stage.still():
            raise StaleSceneError("the disks still move; a push needs a settled scene")
        stroke = Stroke.of_push(scene, push, feasibility.limits)
        if not is_idle(push):
            check_reach(scene, push, feasibility)
            check_gap(scene, push, feasibility)
            self._route(stroke)
        return stroke

    def push(self, push: PushArray, on_step: Observer | None = None, every: int = 1) -> PushOutcome:
        """Carry out one push (3,) and wait until everything is at rest.

        Args:
            push: location, angle and length.
            on_step: called with a `Sample` after each control step; the push is then first
                carried out unseen, so that what is seen is never a push that gets refused.
            every: call it only each so many steps.

        Raises:
            SainError: as `check`; and BlockedError when the tool would come to touch another
                disk. Nothing has moved then, to the last bit.
        """
        stroke = self.check(push)
        before = self.observe()
        if is_idle(push):
            return PushOutcome(before, before.copy(), 0.0, True, self._stage.fallen())
        return self.carry_out(stroke, on_step, every)

    def carry_out(
        self,
        stroke: Stroke,
        on_step: Observer | None = None,
        every: int = 1,
        guarded: bool = True,
    ) -> PushOutcome:
        """Move the tool along a stroke, wherever that leads.

        Args:
            stroke: the tool's way in the world.
            on_step: as in `push`.
            every: as in `push`.
            guarded: refuse when the tool would touch another disk than the mid disk.

        Raises:
            UnreachableError: a pose on the way.
            BlockedError: only when guarded.
        """
        route = self._route(stroke)
        before, start = self.observe(), self._steps
        states, joints = self._stage.states(), self._arm.target
        watch = None if on_step is None else Watch(on_step, every)
        if guarded and watch is not None:  # look ahead
            self._attempt(route, None, guarded, states, joints)
            self._steps = start
        self._attempt(route, watch, guarded, states, joints)
        duration = (self._steps - start) * self.config.motion.time_step
        return PushOutcome(
            before, self.observe(), duration, self._stage.still(), self._stage.fallen()
        )

    def _attempt(
        self,
        route: Route,
        watch: Watch | None,
        guarded: bool,
        states: list[BodyState],
        joints: Joints,
    ) -> None:
        """Carry out a route from these states; when it is blocked, go back to them."""
        steps = self._steps
        self._build(states, joints)
        try:
            self._perform(route, watch, guarded)
        except BlockedError:
            self._build(states, joints)
            self._steps = steps
            raise

    def settle(self, on_step: Observer | None = None, every: int = 1) -> bool:
        """Wait until the disks are settled, for the longest wait at most; tell whether they are."""
        return self._settle(None if on_step is None else Watch(on_step, every), "rest")

    def _route(self, stroke: Stroke) -> Route:
        motion = self.config.motion
        joints = self._arm.kinematics.joints
        tips = motion.stroke(stroke.start, stroke.end)
        above_start, above_end = (
            np.array([*tip[:2], motion.raised]) for tip in (tips[0], tips[-1])
        )
        return Route(
            approach=joints(motion.arc(self._arm.commanded_tip(), above_start)),
            lower=joints(motion.line(above_start, tips[0])),
            stroke=joints(tips),
            lift=joints(motion.line(tips[-1], above_end)),
        )

    def _perform(self, route: Route, watch: Watch | None, guarded: bool) -> None:
        """Lower, push, wait, lift."""
        if self.config.full_motion:
            self._follow(route.approach, "approach", watch, guarded)
            self._follow(route.lower, "approach", watch, guarded)
        else:
            self._arm.place(route.stroke[0])
        self._follow(route.stroke, "push", watch, guarded)
        self._settle(watch, "settle", guarded)
        if self.config.full_motion:
            self._follow(route.lift, "lift", watch, guarded)
            self._settle(watch, "settle", guarded)
        else:
            self._arm.place(route.lift[-1])

    def _follow(self, joints: Joints, phase: str, watch: Watch | None, guarded: bool) -> None:
        for _ in self._arm.follow(joints):
            self._step(phase, watch, guarded)

    def _settle(self, watch: Watch | None, phase: str, guarded: bool = False) -> bool:
        """Step until the disks are still at two looks in a row."""
        still = 0
        wait = round(self.config.max_settle_time / self.config.motion.time_step)
        for step in range(1, wait + 1):
            self._step(phase, watch, guarded)
            if step % STEPS_PER_LOOK == 0:
                still = still + 1 if self._stage.still() else 0
                if still == 2:
                    return True
        return False

    def _step(self, phase: str, watch: Watch | None, guarded: bool) -> None:
        self._client.stepSimulation()
        self._steps += 1
        if guarded and (disk := self._stage.touches_other(self._arm.body, STICK_LINK)):
            raise BlockedError(
                f"the tool would come to touch disk {disk}; only the mid disk may be touched"
            )
        if watch is not None and self._steps % watch.every == 0:
            watch.observer(self.sample(phase))

    def close(self) -> None:
        """Let go of the world; doing it twice is fine."""
        self._client.close()

    def __enter__(self) -> Self:
        """Return the world itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the world."""
        self.close()


def _side_by_side(parameters: WorldParameters, table: Table) -> Scene:
    """Return a scene with the disks in a row across the table."""
    widths = 2.0 * np.array(parameters.radii) * 2**0.5  # a turned cube is that wide
    y = np.cumsum(widths) - widths / 2
    x = (table.x_min + table.x_max) / 2
    positions = np.stack([np.full_like(y, x), y - widths.sum() / 2], axis=-1)
    return check_scene(parameters.scene(positions), table)
