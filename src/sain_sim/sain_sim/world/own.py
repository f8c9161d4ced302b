"""Worlds that installed packages offer, behind the checks of our own."""

from collections.abc import Callable
from typing import Final, TypeVar

import numpy as np

from sain_arm.planning.push_planner import PushPlan, PushPlanner
from sain_core.errors import SainError
from sain_core.feasibility import Stroke
from sain_core.guarding.plugins import package_of
from sain_core.shapes.bodies import check_bodies
from sain_core.types import PushArray, Scene
from sain_core.world import Outcome, Setting, WorldFailedError, check_outcome
from sain_sim.world.engines import (
    DEFAULT_ENGINE,
    ENGINES,
    OFFERED,
    load_world,
)
from sain_sim.world.parameters import WorldParameters, on_a_grid
from sain_sim.world.truth import check_roughness
from sain_sim.world.workcell import TIME_STEP, Route, Sample, Watch, WorldConfig
from sain_sim.world.world import CheckedWorld, World

T = TypeVar("T")

MOST_TIME: Final = 3600.0  # [s], of a push
REPAIR: Final = "repair or uninstall that package"


class OwnWorld(CheckedWorld):
    """A stranger's world. Our arm shows the tool's way; the bodies move when the push has ended."""

    def __init__(
        self, parameters: WorldParameters, config: WorldConfig = WorldConfig(), engine: str = ""
    ) -> None:
        """Load the world of this name, with the bodies on a grid; `reset` places them.

        Raises:
            ConfigError: see `load_world`.
            WorldFailedError: it fails.
        """
        self._planner = PushPlanner(config.arm, config=config.motion)
        self.config, self.engine, self.parameters = config.fitted(self._planner), engine, parameters
        self._package = package_of(OFFERED.find(engine))
        self._world = load_world(engine)
        self._joints = config.arm.home
        self._time = 0.0
        table = config.feasibility.table
        self.load(check_bodies(on_a_grid(parameters, table), parameters.bodies, table))

    def load(self, scene: Scene, parameters: WorldParameters | None = None) -> None:
        """Put the bodies in a scene (N, 8), without checks of the scene."""
        wanted = parameters or self.parameters
        check_roughness(self.engine, wanted.roughness)
        setting = Setting(scene.copy(), wanted.bodies, wanted.friction)
        self._scene = self._checked("reset", scene, lambda: self._world.reset(setting))
        self.parameters = wanted

    @property
    def time(self) -> float:
        """Simulated time [s] since the world was made: that of the tool."""
        return self._time

    def observe(self) -> Scene:
        """Return the disks' states (N, 8) as they are."""
        return self._scene.copy()

    def sample(self, phase: str = "rest") -> Sample:
        """Return the arm and the disks as they are."""
        tip = self._planner.arm.tip(self._joints)
        rest = np.zeros_like(self._joints)
        return Sample(self._time, self._joints, rest, tip, tip, self.observe(), phase)

    def still(self) -> bool:
        """Return whether every body is settled: it always is."""
        return True

    def plan(self, stroke: Stroke) -> PushPlan:
        """Return the motion of the arm for a stroke from here, which is shown."""
        return self._planner.plan(stroke, self._scene, None)

    def _execute(
        self, stroke: Stroke, push: PushArray, watch: Watch | None, seen: Scene | None
    ) -> Outcome:
        """Let the stranger's world push.

        Raises:
            SainError: the world refuses. The bodies are put back.
            WorldFailedError: the world raised anything else, or what it returned breaks the
                contract. The bodies are put back.
        """
        before = self.observe()
        plan = self.plan(stroke)
        joints = Route.of(plan, plan.approach.positions[-1:]).stroke
        took = len(joints) * TIME_STEP

        def perform() -> object:
            nonlocal took
            outcome = self._world.push(push.copy(), seen=seen)
            took = _duration(outcome.duration) or took
            return outcome.after

        try:
            after = self._checked("push", before, perform)
        except SainError:
            self.load(before)
            raise
        begun = self._time
        for step, place in enumerate(joints, start=1):
            self._joints, self._time = place, begun + took * step / len(joints)
            if watch is not None and step % watch.every == 0:
                watch.observer(self.sample("push"))
        self._scene = after
        fallen = ~self.config.feasibility.table.contains(after[:, :2])
        return Outcome(before, self.observe(), self._time - begun, True, fallen)

    def _checked(self, method: str, before: Scene, call: Callable[[], object]) -> Scene:
        """Return a copy of the scene that a method of the world leads to."""
        where = f"engine {self.engine!r} of {self._package}: {method}"
        try:
            return check_outcome(before, call()).copy()
        except WorldFailedError as error:
            raise WorldFailedError(f"{where}: {error}; {REPAIR}") from error
        except SainError:
            raise
        except Exception as error:
            name = type(error).__name__
            raise WorldFailedError(f"{where} raised {name}: {error}; {REPAIR}") from error

    def close(self) -> None:
        """Nothing is held."""


def _duration(given: object) -> float:
    """Return the time [s] that a stranger's push took; 0: it does not tell."""
    if not isinstance(given, (int, float)) or not 0.0 <= given <= MOST_TIME:
        raise WorldFailedError(f"the duration is {given!r}; allowed: 0 to {MOST_TIME:g} s")
    return float(given)


def open_world(
    parameters: WorldParameters,
    config: WorldConfig = WorldConfig(),
    engine: str = DEFAULT_ENGINE,
) -> CheckedWorld:
    """Return a world in an engine of this name: a built-in one, or one that a package offers.

    Raises:
        ConfigError: see `sain_sim.world.engines.check_engine`.
        WorldFailedError: a package's world fails.
    """
    if engine in ENGINES:
        return World(parameters, config, engine)
    return OwnWorld(parameters, config, engine)
