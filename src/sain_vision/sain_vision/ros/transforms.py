"""``tf2_msgs/TFMessage``: frames as they come on ``/tf`` and ``/tf_static``."""

import numpy as np
from tf2_msgs.msg import TFMessage

from sain_core.ros import codec
from sain_vision.scene.frame_tree import FrameTree


def take_transforms(tree: FrameTree, message: TFMessage, static: bool) -> None:
    """Let a tree take the frames of a message, those that never move or others.

    Raises:
        InvalidInputError: see `FrameTree.take`.
    """
    for one in message.transforms:
        place, turn = one.transform.translation, one.transform.rotation
        stamp = np.inf if static else codec.decode_time(one.header.stamp)
        given = (place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w)
        tree.take(one.header.frame_id, one.child_frame_id, *given, stamp)
