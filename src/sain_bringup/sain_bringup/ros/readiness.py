"""Is the graph really up? Every part there, and each connected with all that it talks to."""

from collections.abc import Iterable, Iterator
from typing import Final, NamedTuple

from rclpy.client import Client
from rclpy.node import Node

from sain_bringup.graph import MODEL, PLANNER, RECORDER, SIMULATOR
from sain_interfaces.srv import DescribeModel, ResetScene, Rollout
from sain_model import commands as commands_of_model
from sain_mppi import commands as commands_of_mppi
from sain_sim import commands as commands_of_sim

PROCESSES: Final = {  # by the name of the node in each
    "sim_node": SIMULATOR,
    "model_node": MODEL,
    "mppi_node": PLANNER,
    "recorder": RECORDER,
}
NODES: Final = {
    "sim_node": commands_of_sim.sim_node,
    "model_node": commands_of_model.model_node,
    "mppi_node": commands_of_mppi.mppi_node,
}
SERVERS: Final = {service: name for name, node in NODES.items() for service in node.offers}
SERVER_PARTS: Final = {  # that the director asks
    "reset_scene": ResetScene,
    "rollout": Rollout,
    "describe_model": DescribeModel,
}
PUBLISHED: Final = {name: node.publishes for name, node in NODES.items()} | {
    "closed_loop": ("goal",)
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
            listeners = [other for other, command in NODES.items() if topic in command.subscribes]
            for listener in ("recorder", *listeners):
                if listener not in found:
                    yield Missing(PROCESSES[listener], f"{PROCESSES[listener]} on {name}")
