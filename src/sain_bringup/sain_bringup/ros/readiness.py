"""Is the graph really up? Every part there, and each connected with all that it talks to."""

from collections.abc import Iterable, Iterator
from typing import Final, NamedTuple

from rclpy.client import Client
from rclpy.node import Node

from sain_bringup.graph import MODEL, PLANNER, RECORDER, SIMULATOR

PROCESSES: Final = {  # by the name of the node in each
    "sim_node": SIMULATOR,
    "model_node": MODEL,
    "mppi_node": PLANNER,
    "recorder": RECORDER,
}
SERVERS: Final = {
    "reset_scene": "sim_node",
    "rollout": "model_node",
    "describe_model": "model_node",
}
PUBLISHED: Final = {
    "sim_node": (
        "scene",
        "push_result",
        "physics_prediction",
        "world_parameters",
        "joint_states",
        "markers",
        "/clock",
    ),
    "mppi_node": ("push", "plan", "plan_markers"),
    "model_node": ("/diagnostics",),
    "closed_loop": ("goal",),
}
LISTENERS: Final = {  # besides the recorder, which listens to all
    "scene": ("mppi_node",),
    "goal": ("mppi_node",),
    "push_result": ("mppi_node",),
    "push": ("sim_node",),
}


class Missing(NamedTuple):
    """Something that is not there yet, and the process that should see to it."""

    process: str
    what: str


def missing_parts(node: Node, clients: Iterable[Client]) -> list[Missing]:
    """Return everything that the graph still lacks, as this node sees it."""
    parts = [
        Missing(
            PROCESSES[SERVERS[client.srv_name.rpartition("/")[2]]], f"service {client.srv_name}"
        )
        for client in clients
        if not client.service_is_ready()
    ]
    return [*parts, *_missing_topics(node)]


def _missing_topics(node: Node) -> Iterator[Missing]:
    for publisher, topics in PUBLISHED.items():
        for topic in topics:
            name = node.resolve_topic_name(topic)
            publishers = {info.node_name for info in node.get_publishers_info_by_topic(name)}
            if publisher not in publishers:
                yield Missing(PROCESSES[publisher], f"topic {name}")
                continue
            found = {info.node_name for info in node.get_subscriptions_info_by_topic(name)}
            for listener in ("recorder", *LISTENERS.get(topic, ())):
                if listener not in found:
                    yield Missing(PROCESSES[listener], f"{PROCESSES[listener]} on {name}")
