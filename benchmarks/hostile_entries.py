"""What the three nodes take: a valid message for each entry, and its fatal fields."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from geometry_msgs.msg import PoseStamped

from sain_core.ros import codec
from sain_core.scene import make_scene
from sain_core.shapes.bodies import Bodies as CoreBodies
from sain_interfaces import action, msg, srv

PACKAGES: Final = {"sim_node": "sain_sim", "model_node": "sain_model", "mppi_node": "sain_mppi"}
SCENE: Final = make_scene(
    np.array([(0.40, 0.0), (0.541, 0.0)]), np.array([8.0, 8.0]), np.array([0.08, 0.06])
)


@dataclass(frozen=True)
class Entry:
    """What a node takes, a valid message for it, and the fields whose wrong values are fatal."""

    node: str
    name: str
    kind: Any
    valid: Any
    fatal: tuple[str, ...]
    text: str = ""  # the field that takes text of 10 MB


def entries() -> list[Entry]:
    """Return all entries of the three nodes."""
    disks, stamp = codec.encode_disks(SCENE), codec.encode_time(0)
    past = {"past": 0}
    asked = {"scene": codec.encode_floats(SCENE), "pushes": codec.encode_floats(np.zeros((4, 3)))}
    rollout = srv.Rollout.Request(samples=2, horizon=2, disks=2, **past, **asked)
    predict = srv.PredictResidual.Request(batch=1, disks=2, **past)
    predict.scenes, predict.pushes = asked["scene"], codec.encode_floats(np.zeros(3))
    scene = codec.encode_scene(SCENE, stamp=stamp, episode_id=1, scene_id=1, settled=True)
    two = CoreBodies.named(("disk", "t"), ())
    bodies = codec.encode_bodies(two, (0.08, 0.06), stamp=stamp, episode_id=1)
    goal = codec.encode_goal(np.array([0.7, 0.0]), stamp=stamp, goal_id=1, tolerance=0.02)
    push = msg.Push(episode_id=1, scene_id=1, length=0.1, source="flood", disks=disks)
    result = msg.PushResult(push=push, before=scene, after=scene, episode_id=1, push_id=1)
    sizes = ("disks", "scene", "pushes", "push_bodies", "shapes", "roles", "past", "past_scenes")
    reset = ("disks", "shapes", "roles", "world", "friction")
    aims = ("x", "y", "tolerance", "poses", "keep")
    sim, model, mppi = PACKAGES
    return [
        Entry(sim, "push", msg.Push, push, ("location", "length", "body", "disks"), "source"),
        Entry(
            sim, "reset_scene", srv.ResetScene, srv.ResetScene.Request(disks=disks), reset, "world"
        ),
        Entry(model, "rollout", srv.Rollout, rollout, ("samples", "horizon", *sizes), "roles"),
        Entry(
            model, "predict_residual", srv.PredictResidual, predict, ("batch", "scenes"), "shapes"
        ),
        Entry(model, "load_model", srv.LoadModel, srv.LoadModel.Request(), ("model",), "model"),
        Entry(model, "describe_model", srv.DescribeModel, srv.DescribeModel.Request(), ()),
        Entry(mppi, "scene", msg.Scene, scene, ("disks",), "header"),
        Entry(mppi, "shapes", msg.Bodies, bodies, ("bodies",), "header"),
        Entry(mppi, "goal", msg.Goal, goal, aims, "header"),
        Entry(mppi, "goal_pose", PoseStamped, PoseStamped(), ("pose",), "header"),
        Entry(mppi, "push_result", msg.PushResult, result, ("before", "after"), "error_message"),
        Entry(mppi, "reach", action.Reach, action.Reach.Goal(goal=goal), ("goal",)),
    ]
