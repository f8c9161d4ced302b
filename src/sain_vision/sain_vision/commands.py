"""The executables of this package, with the modules of it that they load."""

from typing import Final

from sain_core.cli.command_line import Command
from sain_core.cli.node_command import NodeCommand

tag_node: Final = NodeCommand(
    "sain_vision tag_node",
    about="Finds tags on the tops of bodies in a camera's images, and publishes the bodies' poses"
    " with covariance. A YAML file states which tags a body has.",
    node="ros.tag_node:TagNode",
    settings="ros.settings:TagNodeConfig",
    publishes=("detections", "camera/overlay", "/diagnostics"),
    subscribes=("camera/color/image_raw", "camera/color/camera_info", "/tf", "/tf_static"),
    example="bodies:=bodies.yaml",
)
outline_node: Final = NodeCommand(
    "sain_vision outline_node",
    about="Finds bodies without tags in a depth camera's images, by their outlines, and publishes"
    " their poses with covariance. The arm may hide a part of a body.",
    node="ros.outline_node:OutlineNode",
    settings="ros.settings:OutlineNodeConfig",
    publishes=("detections", "camera/outlines", "/diagnostics"),
    subscribes=(
        "camera/aligned_depth_to_color/image_raw",
        "camera/color/camera_info",
        "plan",
        "/joint_states",
        "/tf",
        "/tf_static",
    ),
    example="bodies:=bodies.yaml",
)
scene_node: Final = NodeCommand(
    "sain_vision scene_node",
    about="Makes scenes of the poses of bodies: with ids, velocities and whether all rest. Poses"
    " come as detections, as frames on /tf, on topics of their own or as an array. A YAML file"
    " states shapes and masses.",
    node="ros.scene_node:SceneNode",
    settings="scene.body_track:TrackingConfig",
    publishes=("scene", "shapes", "estimates", "markers", "/diagnostics"),
    subscribes=("detections", "poses", "/tf", "/tf_static", "push", "push_result"),
    example="bodies:=bodies.yaml",
)
calibrate_camera: Final = Command("sain_vision calibrate_camera", "ros.calibrate_camera", ros=True)
new_shape: Final = Command("sain_vision new_shape", "ros.new_shape", ros=True, without_ros="--mesh")
print: Final = Command("sain_vision print", "cli.print_tags")  # noqa: A001 - its name
