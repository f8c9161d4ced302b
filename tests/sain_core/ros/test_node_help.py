"""What a node's help says of its topics and services is what the running node has."""

import re

import pytest
from rclpy.action import get_action_server_names_and_types_by_node
from rclpy.node import Node

from sain_core.cli.node_command import NodeCommand
from sain_model.commands import model_node
from sain_model.ros.model_node import ModelNode
from sain_mppi.commands import mppi_node
from sain_mppi.ros.mppi_node import MppiNode
from sain_sim.commands import sim_node
from sain_sim.ros.sim_node import SimNode

ROS_OWN = re.compile(r"/rosout|/parameter_events|/sain/\w+_node/\w+|.*/_(action|owner)/\w+")
PARAMETERS = {SimNode: {"peer_wait": 0.0}, ModelNode: {"model": "planar"}, MppiNode: {}}


def names(found: list[tuple[str, list[str]]]) -> set[str]:
    return {name.removeprefix("/sain/") for name, _ in found if not ROS_OWN.fullmatch(name)}


@pytest.mark.parametrize(
    ("command", "kind"), [(sim_node, SimNode), (model_node, ModelNode), (mppi_node, MppiNode)]
)
def test_the_help_names_every_topic_and_service(graph, command: NodeCommand, kind) -> None:
    node: Node = graph.start(kind, **PARAMETERS[kind])
    here = (node.get_name(), node.get_namespace())
    publishes = node.get_publisher_names_and_types_by_node(*here)
    assert names(publishes) == set(command.publishes)
    assert names(node.get_subscriber_names_and_types_by_node(*here)) == set(command.subscribes)
    assert names(node.get_service_names_and_types_by_node(*here)) == set(command.offers)
    assert names(node.get_client_names_and_types_by_node(*here)) == set(command.calls)
    actions = get_action_server_names_and_types_by_node(node, *here)
    assert names(actions) == set(command.actions)
    text = "\n".join(command.help())
    assert all(name in text for name in (*command.publishes, *command.offers, *command.actions))
