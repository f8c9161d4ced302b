"""The laboratory as a world: pushes go the whole way through planner, controller and arm."""

from typing import Final

import numpy as np

from sain_arm.laboratory.cell import Cell, settle
from sain_arm.laboratory.controller import Controller
from sain_arm.laboratory.laboratory_config import LaboratoryConfig
from sain_arm.planning.arm_config import MotionConfig
from sain_arm.planning.push_events import Ended
from sain_arm.planning.push_planner import PushPlanner
from sain_arm.planning.timing import Trajectory
from sain_arm.robot.robot import Robot
from sain_core.errors import SainError
from sain_core.feasibility import Feasibility, checked_stroke
from sain_core.scene import POSE, VELOCITY
from sain_core.shapes.body_file import BodyFile
from sain_core.types import PushArray, Scene
from sain_core.world import Outcome, WorldFailedError

AT_ONCE: Final = 50  # steps between two looks whether a goal has ended


class LaboratoryWorld:
    """A `sain_core.world.AnyWorld` of one robot and the bodies of a file.

    Attributes:
        cell: the simulation, with its report of what was broken.
        pushes: how many were made.
        refused: reasons of pushes that were not.
    """

    def __init__(
        self,
        robot: Robot,
        bodies: BodyFile,
        feasibility: Feasibility,
        config: LaboratoryConfig = LaboratoryConfig(),
        motion: MotionConfig = MotionConfig(),
    ) -> None:
        """Set the table; `feasibility` has the robot's table of reach."""
        self.cell = Cell(robot, bodies, config)
        self._bodies, self._feasibility = bodies, feasibility
        self._planner = PushPlanner(robot, bodies.bodies, bodies.radii, motion)
        self._controller = Controller(robot, config, self.cell.joints)
        self.pushes, self.refused = 0, list[str]()

    def reset(self, start: Scene) -> Scene:
        """Put the bodies where a scene (N, 8) has them; the arm stays where it is."""
        self.cell.place(start[:, POSE])
        self._settle()
        return self.observe()

    def observe(self) -> Scene:
        """Return the bodies (N, 8); what rests has no velocity."""
        scene = self.cell.observe()
        if self.cell.at_rest:
            scene[:, VELOCITY] = 0.0
        return scene

    def push(self, push: PushArray, *, seen: Scene | None = None) -> Outcome:
        """Plan a push, carry it out and wait until nothing moves.

        Raises:
            SainError: it cannot be carried out, and why; nothing has moved.
            WorldFailedError: the controller gave up.
        """
        before, began = self.observe(), self.cell.time
        base = before if seen is None else seen
        try:
            stroke = checked_stroke(push, base, True, self._feasibility, self._bodies.bodies)
            plan = self._planner.plan(stroke, base, self.cell.joints)
        except SainError as error:
            self.refused.append(f"{type(error).__name__}: {error}")
            raise
        self.pushes += 1
        for part in (plan.approach, plan.stroke):
            self._follow(part)
        settled = self._settle()
        return Outcome(before, self.observe(), self.cell.time - began, settled)

    def clear_view(self, scene: Scene, turn: float) -> None:
        """Bring the arm home, turned [rad], above the bodies of a scene (N, 8), out of sight."""
        self._follow(self._planner.home(scene, self.cell.joints, turn))

    def rest(self, duration: float) -> None:
        """Let time pass [s] while the arm holds still."""
        end = self.cell.time + duration
        while self.cell.time < end:
            self.cell.step(*self._controller.target(self.cell.time))

    def _follow(self, trajectory: Trajectory) -> None:
        self._controller.start(trajectory, self.cell.time)
        while True:
            for _ in range(AT_ONCE):
                self.cell.step(*self._controller.target(self.cell.time))
            ending = self._controller.ending(self.cell.joints, self.cell.time)
            if ending is None:
                continue
            if ending.how is not Ended.SUCCEEDED:
                raise WorldFailedError(f"the controller gave up: {ending.why}")
            return

    def _settle(self) -> bool:
        return settle(self.cell, np.asarray(self._controller.target(self.cell.time)[0]))
