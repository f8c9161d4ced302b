"""``ros2 run sain_bringup reset``: another episode, and where its bodies are."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from rich.console import Console
from rich.markup import escape

from sain_bringup.waiting import WaitOptions
from sain_core.config import MOST_SEED, option
from sain_core.errors import ErrorCode
from sain_core.scene import POSITION
from sain_core.wire import decode_disks

if TYPE_CHECKING:
    from rclpy.node import Node

    from sain_interfaces.srv import ResetScene

SERVICE: Final = "reset_scene"


@dataclass(frozen=True)
class ResetOptions(WaitOptions):
    """Begin another episode in the simulator, and print where its bodies are."""

    seed: int = option(0, "of the episode", minimum=0, maximum=MOST_SEED)


def run(options: ResetOptions, console: Console) -> int:
    """Reset the scene, print what came of it, and return the exit code."""
    from sain_core.ros.node_main import command_node

    with command_node("reset") as node:
        reply = _reset(node, options, console)
    if reply.error_code != ErrorCode.OK:
        console.print(f"[red]not reset[/]: {escape(reply.error_message)}", soft_wrap=True)
        return int(reply.error_code) or 1
    places = decode_disks(reply.scene.disks)[:, POSITION]
    bodies = ", ".join(f"body {body} at ({x:.3f}, {y:.3f}) m" for body, (x, y) in enumerate(places))
    console.print(f"[green]episode {reply.scene.episode_id}[/]: {bodies}", soft_wrap=True)
    return 0


def _reset(node: "Node", options: ResetOptions, console: Console) -> "ResetScene.Response":
    from sain_bringup.ros.listener import SCENES, GraphWait
    from sain_interfaces.srv import ResetScene

    wait = GraphWait(node, console, options.timeout, (SCENES,))
    client, name = node.create_client(ResetScene, SERVICE), node.resolve_service_name(SERVICE)
    wait(client.service_is_ready, f"a simulator on {name}, which a robot has not,")
    answer = client.call_async(ResetScene.Request(seed=options.seed))
    wait(answer.done, f"the answer on {name}")
    return answer.result()
