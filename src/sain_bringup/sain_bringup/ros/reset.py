"""``ros2 run sain_bringup reset``: another episode, and where its bodies are."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final

from rich.console import Console
from rich.markup import escape

from sain_bringup.conditions import show_line
from sain_bringup.ros.push import SilentSimulatorError
from sain_core.config import MOST_SEED, Config, option
from sain_core.errors import ErrorCode
from sain_core.scene import POSITION
from sain_core.wire import decode_disks

if TYPE_CHECKING:
    from rclpy.node import Node

    from sain_interfaces.srv import ResetScene

SERVICE: Final = "reset_scene"


@dataclass(frozen=True)
class ResetOptions(Config):
    """Begin another episode in the simulator, and print where its bodies are."""

    seed: int = option(0, "of the episode", minimum=0, maximum=MOST_SEED)
    timeout: float = option(10.0, "longest wait for the simulator", unit="s", minimum=0.0)


def run(options: ResetOptions, console: Console) -> int:
    """Reset the scene, print what came of it, and return the exit code."""
    from sain_core.ros.node_main import command_node

    with command_node("reset") as node:
        reply = _reset(node, options, partial(show_line, console))
    if reply.error_code != ErrorCode.OK:
        console.print(f"[red]not reset[/]: {escape(reply.error_message)}", soft_wrap=True)
        return int(reply.error_code) or 1
    places = decode_disks(reply.scene.disks)[:, POSITION]
    bodies = ", ".join(f"body {body} at ({x:.3f}, {y:.3f}) m" for body, (x, y) in enumerate(places))
    console.print(f"[green]episode {reply.scene.episode_id}[/]: {bodies}", soft_wrap=True)
    return 0


def _reset(
    node: "Node", options: ResetOptions, show: Callable[[str], None]
) -> "ResetScene.Response":
    from sain_bringup.ros.listener import SCENES, GraphListener
    from sain_core.ros.node_main import spin_until
    from sain_interfaces.srv import ResetScene

    listener, client = GraphListener(node, show, (SCENES,)), node.create_client(ResetScene, SERVICE)
    name = node.resolve_service_name(SERVICE)
    if not spin_until(node, client.service_is_ready, options.timeout):
        missing = listener.absence(SCENES) or f"no simulator serves {name}; a robot has no reset"
        raise SilentSimulatorError(f"{missing} (waited {options.timeout:g} s)")
    answer = client.call_async(ResetScene.Request(seed=options.seed))
    if not spin_until(node, answer.done, options.timeout):
        raise SilentSimulatorError(f"{name} did not answer within {options.timeout:g} s")
    return answer.result()
