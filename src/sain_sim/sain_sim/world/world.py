"""Worlds that push bodies: what all have in common, and the simulated one.

A push becomes one `Stroke` of the tool, which is checked once, at this door, and then performed.
"""

from abc import abstractmethod
from typing import Any, Final, Self

import numpy as np

from sain_arm.planning.push_planner import PushPlan
from sain_arm.robot.robot import Robot, Vector
from sain_core.errors import BlockedError, InvalidInputError
from sain_core.feasibility import Stroke, checked_stroke
from sain_core.scene import MASS, RADIUS
from sain_core.shapes.bodies import check_bodies
from sain_core.types import PushArray, Scene
from sain_core.world import DivergedError, Outcome
from sain_sim.world.engines import DEFAULT_ENGINE, simulation_class
from sain_sim.world.parameters import NOMINAL_FRICTION, WorldParameters, check_stands, on_a_grid
from sain_sim.world.truth import check_roughness
from sain_sim.world.workcell import (
    TIME_STEP,
    CellState,
    Closeable,
    Observer,
    Route,
    Sample,
    Simulation,
    Watch,
    WorldConfig,
)

__all__ = ["CheckedWorld", "World", "WorldConfig"]

MATCH_TOLERANCE: Final = 1e-6  # [kg] or [m]


class CheckedWorld(Closeable):
    """A `sain_core.world.AnyWorld` of bodies with parameters, in an engine.

    Attributes:
        config: how it is simulated.
        engine: its name.
        parameters: what is in it.
    """

    config: WorldConfig
    engine: str
    parameters: WorldParameters

    def reset(self, scene: Scene, parameters: WorldParameters | None = None) -> Scene:
        """Put the disks where a scene (N, 8) has them, at rest, and the arm at home.

        Args:
            scene: the poses; its masses and radii must be those of the parameters.
            parameters: of new disks; None keeps the present ones.

        Returns:
            The scene as observed: the given one with zero velocities.

        Raises:
            InvalidInputError: not a scene, or one of other disks than these.
            OffTableError: a disk off the table.
        """
        wanted = parameters or self.parameters
        _check_same(scene, wanted)
        check_bodies(scene, wanted.bodies, self.config.feasibility.table)
        self.load(scene, parameters)
        return self.observe()

    @abstractmethod
    def load(self, scene: Scene, parameters: WorldParameters | None = None) -> None:
        """Put the disks in a scene (N, 8) without checks; engines push overlapping disks apart."""

    @property
    @abstractmethod
    def time(self) -> float:
        """Simulated time [s] since the world was made; resets do not restart it."""

    @abstractmethod
    def observe(self) -> Scene:
        """Return the disks' states (N, 8) as they are."""

    @abstractmethod
    def sample(self) -> Sample:
        """Return the arm and the disks as they are."""

    @abstractmethod
    def still(self) -> bool:
        """Return whether every body on the table is settled; fallen bodies do not count."""

    def push(
        self,
        push: PushArray,
        on_step: Observer | None = None,
        every: int = 1,
        seen: Scene | None = None,
    ) -> Outcome:
        """Execute one push (5,) and wait until the scene is settled.

        Args:
            push: body, location, angle, length and speed.
            on_step: called with a `Sample` after each control step. What is refused is not shown.
            every: steps between two calls.
            seen: (N, 8), where the bodies are taken to be: the tool's way follows from this. It
                starts a little further back. None: where they are.

        Raises:
            SainError: as `check`; UnreachableError: a pose on the way; BlockedError: the tool would
                touch another body during the push. No bit of the state changes then.
        """
        stroke = self.check(push, seen)
        if stroke.length == 0.0:
            scene = self.observe()
            return Outcome(scene, scene.copy(), 0.0, True, np.zeros(len(scene), dtype=bool))
        watch = None if on_step is None else Watch(on_step, every)
        return self._execute(stroke, push, watch, seen)

    @abstractmethod
    def plan(self, stroke: Stroke) -> PushPlan:
        """Return the motion of the arm for a stroke from here, checked as a whole.

        It depends on scene and stroke alone, and so does its approach, which is the lowering.

        Raises:
            UnreachableError: a pose or a speed that the arm cannot take.
            BlockedError: a link would touch a body, or the tool another one.
        """

    @property
    def robot(self) -> Robot:
        """The robot that pushes."""
        return self.config.arm

    @abstractmethod
    def _execute(
        self, stroke: Stroke, push: PushArray, watch: Watch | None, seen: Scene | None
    ) -> Outcome:
        """Execute a push that was checked, as this stroke."""

    def check(self, push: PushArray, seen: Scene | None = None) -> Stroke:
        """Return the tool's way for a push (5,) that can be carried out from here.

        Only `push` finds a pose that the arm cannot take, or a body that is moved into the tool's
        way.

        Raises:
            SainError: see `checked_stroke`.
        """
        return checked_stroke(
            push,
            self.observe(),
            self.still(),
            self.config.feasibility,
            self.parameters.bodies,
            seen,
        )


def _check_same(scene: Scene, parameters: WorldParameters) -> None:
    """Raise `InvalidInputError` unless a scene (N, 8) has the masses and radii of a world."""
    if len(scene) != parameters.count:
        raise InvalidInputError(
            f"the scene has {len(scene)} bodies; this world has {parameters.count}"
        )
    for column, name, values in (
        (MASS, "mass", parameters.masses),
        (RADIUS, "radius", parameters.radii),
    ):
        wrong = np.abs(scene[:, column] - values) > MATCH_TOLERANCE
        if wrong.any():
            disk = int(np.argmax(wrong))
            raise InvalidInputError(
                f"{name} of body {disk} is {scene[disk, column]:.6g} in the scene and"
                f" {values[disk]:.6g} in this world; they must be the same"
            )


class World(CheckedWorld):
    """One world in one engine, independent of all others.

    Its state is the poses and velocities of its bodies and nothing else. The same state and push
    give the same bytes in any world of any process.
    """

    def __init__(
        self,
        parameters: WorldParameters,
        config: WorldConfig = WorldConfig(),
        engine: str = DEFAULT_ENGINE,
    ) -> None:
        """Start with the bodies on a grid; `reset` places them. The engine is loaded here."""
        self._simulation: Simulation = simulation_class(engine)(config)
        self.config = self._simulation.config
        self.engine = engine
        self.parameters = parameters
        table = config.feasibility.table
        self._planner = self._simulation.planner
        self._planned: tuple[Any, PushPlan] | None = None  # for what, the latest
        self._steps = 0
        self.load(check_bodies(on_a_grid(parameters, table), parameters.bodies, table))

    @classmethod
    def of_scene(cls, scene: Scene, friction: float = NOMINAL_FRICTION) -> Self:
        """Return a world of disks that are where a scene (N, 8) has them, at rest.

        Raises:
            InvalidInputError: not a scene.
            OffTableError: a disk off the table.
            ConfigError: a mass, radius or friction out of range.
        """
        check_bodies(scene, table=WorldConfig().feasibility.table)
        world = cls(WorldParameters.of_scene(scene, friction))
        world.reset(scene)
        return world

    def load(self, scene: Scene, parameters: WorldParameters | None = None) -> None:
        """Put the disks in a scene (N, 8) without checks; engines push overlapping disks apart."""
        wanted = parameters or self.parameters
        check_roughness(self.engine, wanted.roughness)
        check_stands(wanted)
        origin = CellState(self._simulation.resting(scene, wanted), self._simulation.home)
        self.parameters = wanted
        self._build(origin)

    def _build(self, origin: CellState) -> None:
        self._cell = self._simulation.build(self.parameters, origin, self._steps)

    @property
    def time(self) -> float:
        """Simulated time [s] since the world was made; resets do not restart it."""
        return self._cell.time

    def observe(self) -> Scene:
        """Return the disks' states (N, 8) as they are."""
        return self._cell.observe()

    def sample(self) -> Sample:
        """Return the arm and the disks as they are."""
        return self._cell.sample("rest")

    def still(self) -> bool:
        """Return whether every body on the table is settled; fallen bodies do not count."""
        return self._cell.still()

    def _execute(
        self, stroke: Stroke, push: PushArray, watch: Watch | None, seen: Scene | None
    ) -> Outcome:
        return self.carry_out(stroke, watch)

    def carry_out(
        self, stroke: Stroke, watch: Watch | None = None, guarded: bool = True
    ) -> Outcome:
        """Move the tool along a stroke, without the checks of `push`.

        If it is guarded, it is refused when the tool would touch another body than the stroke's.
        With a watch it is then executed once before, unseen.

        Raises:
            UnreachableError: a pose on the way.
            BlockedError: only if it is guarded.
        """
        route = self._route(stroke, guarded)
        pushed = stroke.body if guarded else None
        before, origin = self.observe(), self._cell.now
        if guarded and watch is not None:  # look ahead
            self._attempt(origin, route, None, pushed)
            self._build(origin)
        self._attempt(origin, route, watch, pushed)
        duration = (self._cell.steps - self._steps) * TIME_STEP
        self._steps = self._cell.steps
        cell = self._cell
        return Outcome(before, self.observe(), duration, cell.still(), cell.fallen())

    def _attempt(
        self, origin: CellState, route: Route, watch: Watch | None, pushed: int | None
    ) -> None:
        """Execute a route in a new workcell; when that fails, restore the origin."""
        if self._cell.origin is not origin:
            self._build(origin)
        try:
            self._cell.perform(route, watch, pushed)
        except (BlockedError, DivergedError):
            self._build(origin)
            raise

    def settle(self) -> bool:
        """Wait for the bodies to settle, at most the longest wait; return whether they are."""
        self._cell.settle("rest", None, pushed=None)
        self._steps = self._cell.steps
        return self._cell.still()

    def joint_states(self) -> tuple[Vector, Vector]:
        """Return the arm's positions (J,) [rad] and speeds (J,) [rad/s]."""
        return self._cell.arm.joint_states()

    def step(self, positions: Vector, velocities: Vector) -> None:
        """Make one control step with servos towards positions (J,) and velocities (J,).

        Whatever touches is pushed: this is for who has a clock and a plan of its own.
        """
        self._cell.step(positions, velocities)
        self._steps = self._cell.steps

    def place(self, scene: Scene) -> None:
        """Put the bodies at rest where a scene (N, 8) has them, as by hand; the arm stays."""
        states = self._simulation.resting(scene, self.parameters)
        self._build(CellState(states, self.joint_states()[0]))

    def plan(self, stroke: Stroke) -> PushPlan:
        """Return the motion of the arm for a stroke from here, checked as a whole."""
        bodies, radii = self.parameters.bodies, self.parameters.radii
        scene = self.observe()
        self._planner = self._planner.among(bodies, radii)
        ends = stroke.start.tobytes(), stroke.end.tobytes()
        wanted = (bodies, radii, *ends, stroke.speed, stroke.body, scene.tobytes())
        if self._planned is None or self._planned[0] != wanted:
            self._planned = wanted, self._planner.plan(stroke, scene, None)
        return self._planned[1]

    def _route(self, stroke: Stroke, guarded: bool) -> Route:
        """Return the joints along a push; raises as `plan`, unguarded for poses and speeds."""
        simulation = self._simulation
        if guarded:
            plan, planner = self.plan(stroke), self._planner
        else:
            planner = simulation.planner
            plan = planner.plan(stroke, self.observe(), None)
        if not self.config.full_motion:
            route = Route.of(plan, plan.approach.positions[-1:])
            return route._replace(aside=simulation.home[None]) if self.config.wait_aside else route
        way = planner.approach(plan, self._cell.arm.joint_states()[0], stroke.body)
        route = Route.of(plan, way.sampled(TIME_STEP))
        if not self.config.wait_aside:
            return route
        back = planner.travel(route.aside[-1], simulation.home)
        return route._replace(aside=back.sampled(TIME_STEP))

    def close(self) -> None:
        """Close the world; a second call does nothing."""
        self._simulation.close()
