"""What the laboratory is started with."""

from dataclasses import dataclass

from sain_core.camera.image_camera import ImageCameraConfig
from sain_core.config import MOST_SEED, Config, option


@dataclass(frozen=True)
class LaboratoryConfig(Config):
    """The laboratory: robot and bodies, what is drawn, and the controller with its faults."""

    robot: str = option("", "YAML file of the robot, or the name of a shipped one")
    bodies: str = option("", "YAML file of the bodies")
    place: tuple[float, ...] = option((), "x, y [m] and heading [rad] of each body; none: in a row")
    pace: float = option(
        1.0, "how many times as fast as the wall clock it runs", minimum=0.05, maximum=20.0
    )
    noise: str = option("0,0", "noise of the published poses: METRES,RADIANS")
    poses: bool = option(True, "publish the poses of the bodies; false: a camera sees them")
    twice: bool = option(False, "answer each goal twice, first at once: a fault")
    images: ImageCameraConfig = ImageCameraConfig()
    seed: int = option(0, "of friction, centres of mass and noise", minimum=0, maximum=MOST_SEED)
    table_friction: tuple[float, float] = option((0.15, 0.35), "of bodies on the table")
    tool_friction: tuple[float, float] = option((0.1, 0.3), "of bodies and tool")
    off_centre: float = option(
        0.05, "most that the centre of mass is off, in radii", minimum=0.0, maximum=0.3
    )
    mass: tuple[float, float] = option((0.4, 1.2), "of a body whose file states none", unit="kg")
    delay: float = option(
        0.02, "from the acceptance of a goal to its motion", unit="s", minimum=0.0, maximum=2.0
    )
    path_tolerance: float = option(
        0.15, "error of a joint that aborts a goal", unit="rad", minimum=1e-3
    )
    goal_tolerance: float = option(0.01, "error of a joint at the end", unit="rad", minimum=1e-4)
    goal_time: float = option(1.0, "for the joints to come that near", unit="s", minimum=0.0)
    abort_at: float = option(
        0.0, "time into a goal at which it is aborted; 0: never", unit="s", minimum=0.0
    )
    abort_every: int = option(
        2, "of how many goals one is aborted: 2 is each stroke, after its approach", minimum=1
    )
