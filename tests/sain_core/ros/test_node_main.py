"""Executables as they are started: one clear line and an exit code when they cannot start."""

import re
import signal
import subprocess
import sys

import pytest
from rclpy.action import get_action_server_names_and_types_by_node
from rclpy.node import Node

from sain_model.commands import model_node
from sain_model.ros.model_node import ModelNode
from sain_mppi.commands import mppi_node
from sain_mppi.ros.mppi_node import MppiNode
from sain_sim.commands import sim_node
from sain_sim.ros.sim_node import SimNode

PACKAGES = {"sim_node": "sain_sim", "model_node": "sain_model", "mppi_node": "sain_mppi"}
START_EACH = """
import sys
from importlib import import_module
from sain_core.cli.command_line import load
from sain_core.ros.node_main import run_node

for name, package, arguments in {wrong!r}:
    command = getattr(import_module(f"{{package}}.commands"), name)
    sys.argv = [name, "--ros-args", *arguments]
    print(run_node(load(command.name, command.node), name))
"""  # in one process: each would import PyTorch or Numba for itself
WRONG = {
    "parameter 'sede' is unknown; near it: seed": ("sim_node", "-p", "sede:=3"),
    "'seed' is 'three'; it must be an integer": ("sim_node", "-p", "seed:=three"),
    "parameter 'world' is 'mars'; allowed: 'randomised'": ("sim_node", "-p", "world:=mars"),
    "did you mean 'planar'": ("model_node", "-p", "model:=planer"),
    "/none": ("model_node", "-p", "model:=/none.safetensors"),
    "near it: planner.samples": ("mppi_node", "-p", "planner.sample:=3"),
    "'planner.samples' is 0; it must be at least": ("mppi_node", "-p", "planner.samples:=0"),
    "Couldn't parse params file": ("mppi_node", "--params-file", "/none.yaml"),
}


WORKS = """
import os, signal, sys, time
from rclpy.node import Node
from sain_core.ros.node_main import run_node, steady_timer
from sain_core.ros.worker import Worker

class Works(Node):
    awaits = {awaits}

    def __init__(self):
        super().__init__("works")
        self.worker, self.ticks, self.done = Worker(self, "work"), 0, []
        self.submit("before it spins")
        steady_timer(self, 0.02, self.tick)

    def submit(self, what):
        self.worker.submit(lambda: what, lambda done: self.done.append(done.result()))

    def tick(self):
        self.ticks += 1
        if self.ticks == 10:
            self.submit("later")
        if self.ticks == 20:
            print(self.done)
            os.kill(os.getpid(), signal.SIGINT)

print(run_node(Works, "works"))
"""


def command(name: str, *arguments: str) -> list[str]:
    code = f"import sys; from {PACKAGES[name]}.commands import {name}; sys.exit({name}())"
    return [sys.executable, "-c", code, "--ros-args", *arguments]


def test_what_is_wrong_at_the_start_is_told_in_one_line(ros_domain):
    wrong = [(name, PACKAGES[name], arguments) for name, *arguments in WRONG.values()]
    code = START_EACH.format(wrong=wrong)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout.split() == ["1"] * len(wrong), done.stderr
    lines = [line for line in done.stderr.splitlines() if line.startswith(tuple(PACKAGES))]
    assert len(lines) == len(wrong), done.stderr
    for line, (text, (name, *_)) in zip(lines, WRONG.items(), strict=True):
        assert line.startswith(f"{name}:") and text in line
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("awaits", [True, False])
def test_either_executor_calls_timers_and_hands_work_back(awaits, ros_domain):
    code = WORKS.format(awaits=awaits)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout.splitlines() == ["['before it spins', 'later']", "0"], done.stderr


def test_a_node_that_is_told_to_stop_stops_cleanly(ros_domain):
    process = subprocess.Popen(command("sim_node"), stderr=subprocess.PIPE, text=True)
    for line in process.stderr:
        if "ready" in line:
            break
    process.terminate()
    _, rest = process.communicate(timeout=60)
    assert process.returncode == 0, rest
    assert "Traceback" not in rest


def test_push_and_watch_work_from_a_terminal(ros_domain):
    alone = tool("watch", "--timeout", "0.5")
    assert alone.returncode == 1
    assert alone.stderr.strip() == "watch: no other node in 0.5 s; is anything running?"
    simulator = subprocess.Popen(command("sim_node"), stderr=subprocess.PIPE, text=True)
    try:
        push = tool("push", "--length", "0.1")
        assert push.returncode == 0, push.stderr
        assert "was carried out" in push.stdout
        blocked = tool("push", "--location", "3.1415")
        assert blocked.returncode == 9, blocked.stderr
        assert "was refused: BLOCKED" in " ".join(blocked.stdout.split())
        watch = tool("watch", "scene", "--count", "2")
        assert watch.returncode == 0, watch.stderr
        assert watch.stdout.count("scene_id: 2\n") == 2
        topics = tool("watch")
        assert "/sain/scene  [sain_interfaces/msg/Scene]" in topics.stdout
        unknown = tool("watch", "scenes")
        assert unknown.returncode == 1
        assert unknown.stderr.strip() == (
            "watch: nobody publishes /sain/scenes; did you mean /sain/scene?"
        )
    finally:
        simulator.send_signal(signal.SIGINT)
        simulator.communicate(timeout=60)


def tool(name: str, *arguments: str) -> "subprocess.CompletedProcess[str]":
    code = f"import sys; from sain_bringup.commands import {name}; sys.exit({name}())"
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, timeout=120
    )


ROS_OWN = re.compile(r"/rosout|/parameter_events|/sain/\w+_node/\w+|.*/_(action|owner)/\w+")
PARAMETERS = {SimNode: {}, ModelNode: {"model": "planar"}, MppiNode: {}}


def names(found: list[tuple[str, list[str]]]) -> set[str]:
    return {name.removeprefix("/sain/") for name, _ in found if not ROS_OWN.fullmatch(name)}


@pytest.mark.parametrize(
    ("command", "kind"), [(sim_node, SimNode), (model_node, ModelNode), (mppi_node, MppiNode)]
)
def test_the_help_names_every_topic_and_service(graph, command, kind):
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
