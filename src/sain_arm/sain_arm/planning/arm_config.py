"""How a tool moves, in simulation and in steel, and what the driver of an arm is started with."""

from dataclasses import dataclass, replace
from typing import Self

from sain_core.config import Config, option
from sain_core.feasibility import Feasibility
from sain_core.scene import DISK_HEIGHT


@dataclass(frozen=True)
class MotionConfig(Config):
    """How the tool moves; a push has its own speed."""

    tip_height: float = option(
        0.01, "height of the tip above the table in a stroke", unit="m", minimum=0.002, maximum=0.03
    )
    clearance: float = option(
        0.02, "between the tops of bodies and the tip that travels", unit="m", minimum=0.005
    )
    travel_speed: float = option(1.0, "out of contact", unit="m/s", minimum=0.01, maximum=2.0)
    travel_acceleration: float = option(
        10.0, "likewise; the joints' limits hold, too", unit="m/s^2", minimum=0.1, maximum=50.0
    )
    acceleration: float = option(
        4.0, "of the tool in a stroke", unit="m/s^2", minimum=0.1, maximum=20.0
    )
    ahead: bool = option(
        True, "go on after a stroke to where the next one is expected, while bodies come to rest"
    )

    @property
    def raised(self) -> float:
        """Height [m] of the tip that travels."""
        return DISK_HEIGHT + self.clearance

    def over(self, top: float) -> Self:
        """Return the same motion above bodies that are so high [m], or as high as ours."""
        return replace(self, clearance=self.clearance + max(top - DISK_HEIGHT, 0.0))


@dataclass(frozen=True)
class ArmConfig(Config):
    """The robot, and how it is moved."""

    robot: str = option("", "YAML file of the robot, or the name of a shipped one")
    dry_run: bool = option(False, "plan and show each push as a ghost; move nothing")
    enable_timeout: float = option(
        0.3, "age of the enable signal above which the arm stops", unit="s", minimum=0.05
    )
    joints_timeout: float = option(
        0.5, "age above which joint states are not used", unit="s", minimum=0.05
    )
    scene_timeout: float = option(
        0.5, "age above which no push is made from a scene", unit="s", minimum=0.05, maximum=5.0
    )
    patience: float = option(
        5.0, "that a goal may take longer than planned", unit="s", minimum=0.5, maximum=15.0
    )
    motion: MotionConfig = MotionConfig()
    feasibility: Feasibility = Feasibility()
