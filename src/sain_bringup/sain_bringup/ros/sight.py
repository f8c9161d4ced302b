"""Episodes of a graph whose scenes come from images: its nodes are given the bodies of each one."""

from pathlib import Path
from typing import Any

from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient

from sain_bringup.graph import SEEN_BODIES
from sain_bringup.ros.progress import seeing_nodes
from sain_core.errors import SainError
from sain_core.ros.qos import RELIABLE
from sain_core.shapes.body_file import write_tagged_bodies
from sain_eval.scenes.families import ScenarioScene
from sain_interfaces.msg import Scene


class Sight:
    """What a director does beyond resets where bodies are seen. All calls return at once."""

    def __init__(self, node: Node, folder: Path, see: str) -> None:
        """Write files of bodies into a folder, for the nodes that see them in this way."""
        self.see = see
        self._folder, self._count = folder, 0
        self._clients = [
            AsyncParameterClient(node, node.resolve_topic_name(name)) for name in seeing_nodes(see)
        ]
        self._replies: list[Any] = []
        self._latest = self._before = self._episode = 0
        self._answered = False
        node.create_subscription(Scene, "scene", self._on_scene, RELIABLE)

    def show(self, case: ScenarioScene) -> None:
        """Have the nodes look for the bodies of a case, which lie on the table by now."""
        self._count += 1
        path = (self._folder / f"bodies_{self._count}.yaml").absolute()
        for one in (path, self._folder / SEEN_BODIES):  # the latter for a node that is restarted
            write_tagged_bodies(one, case.disks, case.bodies)
        self._episode, self._answered = 0, False
        given = [Parameter("bodies", value=str(path))]
        self._replies = [client.set_parameters(given) for client in self._clients]

    @property
    def episode_id(self) -> int:
        """The episode that began with what was shown last; 0: it has not begun."""
        if not self._answered and all(reply.done() for reply in self._replies):
            for one in (one for reply in self._replies for one in reply.result().results):
                if not one.successful:
                    raise SainError(f"a file of bodies was refused: {one.reason}")
            # Bodies must rest for a while before an episode begins: the next one is not here yet.
            self._answered, self._before = True, self._latest
        return self._episode

    def _on_scene(self, message: Scene) -> None:
        self._latest = max(self._latest, int(message.episode_id))
        if self._answered and message.settled and message.episode_id > self._before:
            self._episode = int(message.episode_id)
