"""What the nodes read. No middleware here: the help of a node needs none."""

from dataclasses import dataclass

from sain_core.config import Config, option
from sain_vision.detection.outlines import OutlineConfig
from sain_vision.detection.tags import TagConfig
from sain_vision.scene.body_track import BODIES

COLOUR_TOPICS = ("camera/color/image_raw", "camera/color/camera_info")
DEPTH_TOPICS = ("camera/aligned_depth_to_color/image_raw", "camera/color/camera_info")


@dataclass(frozen=True)
class CameraInputConfig(Config):
    """Which images are used, and the bodies that are looked for in them."""

    bodies: str = option("", BODIES, live=True)
    frame: str = option("world", "frame of the poses, with the table at z = 0 and z up")
    max_age: float = option(0.5, "age above which images are not used", unit="s", minimum=0.02)
    extrinsics: str = option(
        "", "file of `calibrate_camera`, whose pose goes to /tf_static; empty: it comes from there"
    )


@dataclass(frozen=True)
class TagNodeConfig(CameraInputConfig):
    """What the node of tags reads."""

    tags: TagConfig = TagConfig()


@dataclass(frozen=True)
class OutlineNodeConfig(CameraInputConfig):
    """What the node of outlines reads."""

    robot: str = option(
        "", "YAML file or name of the robot, whose arm hides bodies; empty: what is high is the arm"
    )
    search_period: float = option(
        1.0, "time between searches of the whole image for bodies that are lost", unit="s",
        minimum=0.1,
    )  # fmt: skip
    outlines: OutlineConfig = OutlineConfig()
