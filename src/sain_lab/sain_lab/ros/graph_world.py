"""Session on a graph that runs: pushes are sent as a person would, and the graph's learner learns.

A simulator is reset to a scene of the scenario now and then. Without one, as with a robot, all
pushes are made from where the bodies are.
"""

from collections.abc import Callable, Generator
from dataclasses import replace
from itertools import count
from typing import Any, Final

from rclpy.node import Node

from sain_core import wire
from sain_core.errors import ConfigError, ErrorCode, ModelUnavailableError, error_from_reply
from sain_core.push import push_ids
from sain_core.ros.codec import encode_disks, encode_push
from sain_core.ros.node_main import command_node, spin_until
from sain_core.ros.qos import LATCHED, RELIABLE
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import PushArray, Scene
from sain_core.wire.bodies import decode_bodies
from sain_core.world import Outcome
from sain_eval.scenes.families import ScenarioScene
from sain_interfaces.msg import Bodies as BodiesMessage
from sain_interfaces.msg import Push, PushResult
from sain_interfaces.msg import Scene as SceneMessage
from sain_interfaces.srv import ResetScene
from sain_lab.exploration.session import Session, SessionResult, scene_of, work_of
from sain_lab.serving import believed
from sain_lab.settings import TeachOptions
from sain_lab.storage.laboratory import Laboratory
from sain_model.dynamics.sain import SainDynamics

PATIENCE: Final = 30.0  # [s], for a scene, a result or a reset
FIRST: Final = 3.0  # [s], for a simulator to be found


def teach_on_graph(settings: TeachOptions) -> SessionResult:
    """Teach on the graph that runs.

    Raises `ModelUnavailableError`: no node answers on the graph; `ConfigError`: its bodies are
    others than those of the scenario; `NoPushError`: no push is possible from where the bodies are.
    """
    believing = _Believing(settings.laboratory)
    with command_node("teach") as node:
        world = GraphWorld(node)
        session = Session(believing, work_of(settings, believing()))
        return session.run(_rooms(world, settings), settings)


def _rooms(
    world: "GraphWorld", settings: TeachOptions
) -> Generator[tuple["GraphWorld", ScenarioScene], None, None]:
    """Yield the graph, reset to scenes of the scenario where that is possible."""
    for seed in count(settings.seed):
        case = scene_of(settings, seed)
        if world.has_simulator:
            world.reset(case)
        scene = world.observe()
        bodies = world.bodies.fitted(len(scene))
        if bodies != case.bodies:
            raise ConfigError(
                f"the graph has the bodies {_names(bodies)}; scenario {settings.scenario} has"
                f" {_names(case.bodies)}: give another --scenario"
            )
        yield world, replace(case, disks=scene)


def _names(bodies: Bodies) -> str:
    return ", ".join(shape.name for shape in bodies.shapes)


class _Believing:
    """The physics that a laboratory believes, read again where its learner has written."""

    def __init__(self, name: str) -> None:
        self._laboratory = Laboratory.named(name)
        self._read: tuple[int, SainDynamics] | None = None

    def __call__(self) -> SainDynamics:
        path = self._laboratory.belief_path
        written = path.stat().st_mtime_ns if path.exists() else 0
        if self._read is None or self._read[0] != written:
            self._read = written, believed(self._laboratory)
        return self._read[1]


class GraphWorld:
    """The graph as a world: an `sain_core.world.AnyWorld`."""

    def __init__(self, node: Node) -> None:
        self._node, self._ids = node, push_ids()
        self.bodies: Bodies = PAPER_DISKS
        self._scene: SceneMessage | None = None
        self._result: PushResult | None = None
        self._publisher = node.create_publisher(Push, "push", RELIABLE)
        node.create_subscription(SceneMessage, "scene", self._on_scene, RELIABLE)
        node.create_subscription(PushResult, "push_result", self._on_result, RELIABLE)
        node.create_subscription(BodiesMessage, "shapes", self._on_bodies, LATCHED)
        self._reset = node.create_client(ResetScene, "reset_scene")
        self.has_simulator = self._reset.wait_for_service(FIRST)

    def reset(self, case: ScenarioScene, /) -> Scene:
        """Begin an episode with a scene; raises as the simulator does."""
        request = ResetScene.Request(
            seed=case.seed,
            disks=encode_disks(case.disks),
            shapes=list(case.shapes),
            roles=list(map(str, case.roles)),
        )
        asked = self._reset.call_async(request)
        self._wait(asked.done, "the simulator did not reset the scene")
        reply = asked.result()
        if reply.error_code != ErrorCode.OK:
            raise error_from_reply(reply.error_code, reply.error_message)
        self._scene = None
        episode = reply.scene.episode_id
        self._wait(
            lambda: self._scene is not None and self._scene.episode_id == episode,
            "no scene came after the reset",
        )
        return self.observe()

    def observe(self) -> Scene:
        """Return the settled scene (N, 8)."""
        topic = self._node.resolve_topic_name("scene")
        self._wait(
            lambda: self._scene is not None and self._publisher.get_subscription_count() > 0,
            f"no settled scene on {topic}; start one: graph --learn my_table",
        )
        assert self._scene is not None
        return wire.decode_disks(self._scene.disks)

    def push(self, push: PushArray, *, seen: Scene | None = None) -> Outcome:
        """Send a push, and wait for its result; raises as whoever executes it does."""
        self.observe()
        assert self._scene is not None
        push_id, self._result = next(self._ids), None
        message = encode_push(
            push,
            stamp=self._scene.header.stamp,
            push_id=push_id,
            episode_id=self._scene.episode_id,
            scene_id=self._scene.scene_id,
            source=self._node.get_fully_qualified_name(),
        )
        scene_id = self._scene.scene_id
        self._publisher.publish(message)
        self._wait(
            lambda: self._result is not None and self._result.push_id == push_id,
            "nobody answered the push",
        )
        result: Any = self._result
        if result.error_code != ErrorCode.OK:
            raise error_from_reply(result.error_code, result.error_message)
        self._wait(
            lambda: self._scene is not None and self._scene.scene_id != scene_id,
            "no scene came after the push",
        )
        before, after = (wire.decode_disks(one.disks) for one in (result.before, result.after))
        return Outcome(before, after, result.duration)

    def _wait(self, done: Callable[[], bool], problem: str) -> None:
        if not spin_until(self._node, done, PATIENCE):
            raise ModelUnavailableError(f"{problem} (waited {PATIENCE:g} s)")

    def _on_scene(self, message: SceneMessage) -> None:
        self._scene = message if message.settled else None

    def _on_bodies(self, message: BodiesMessage) -> None:
        self.bodies = decode_bodies(message)

    def _on_result(self, message: PushResult) -> None:
        self._result = message
