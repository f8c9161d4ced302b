"""The view for RViz: it names what RViz has and what the graph publishes."""

import importlib.util
import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import yaml

from sain_bringup.graph_options import GraphOptions
from sain_bringup.rviz import view_of
from sain_core.cli.command_line import read_options
from sain_mppi.commands import mppi_node
from sain_sim.commands import sim_node
from sain_sim.perception.body_file import read_bodies
from tests.paths import ROOT

BRINGUP = ROOT / "src" / "sain_bringup"
VIEW = BRINGUP / "config" / "sain.rviz"
CLASSES = {  # of RViz 2 in Jazzy: plugins_description.xml of rviz_default_plugins, and rviz_common
    *(f"rviz_common/{name}" for name in ("Displays", "Tool Properties", "Views", "Time")),
    *(
        f"rviz_default_plugins/{name}"
        for name in ("Grid", "TF", "RobotModel", "MarkerArray", "Pose")
    ),
    *(
        f"rviz_default_plugins/{name}"
        for name in ("Interact", "MoveCamera", "Select", "FocusCamera")
    ),
    *(f"rviz_default_plugins/{name}" for name in ("Measure", "SetGoal", "Orbit")),
}
STAND_INS = {
    "launch": ("LaunchContext", "LaunchDescription"),
    "launch.actions": ("DeclareLaunchArgument", "EmitEvent", "OpaqueFunction"),
    "launch.events": ("Shutdown",),
    "launch.events.process": ("ProcessExited",),
    "launch.substitutions": ("LaunchConfiguration",),
    "launch_ros": (),
    "launch_ros.actions": ("Node",),
}


def values_of(key: str, tree: Any) -> list[Any]:
    """All values of a key, wherever it stands."""
    if isinstance(tree, list):
        return [value for part in tree for value in values_of(key, part)]
    if not isinstance(tree, dict):
        return []
    own = [tree[key]] if key in tree else []
    return own + [value for part in tree.values() for value in values_of(key, part)]


def topics_of(text: str) -> set[str]:
    return {value for value in values_of("Value", yaml.safe_load(text)) if isinstance(value, str)}


def test_its_classes_are_those_of_rviz():
    assert set(values_of("Class", yaml.safe_load(VIEW.read_text()))) - {""} == CLASSES


def test_its_topics_are_those_of_the_graph():
    said = {f"/sain/{name}" for node in (sim_node, mppi_node) for name in node.publishes}
    heard = {f"/sain/{name}" for name in mppi_node.subscribes}
    topics = topics_of(VIEW.read_text())
    assert topics - {"/sain/goal_pose"} <= said
    assert topics >= {f"/sain/{name}" for name in ("robot_description", "markers", "plan_markers")}
    tools = yaml.safe_load(VIEW.read_text())["Visualization Manager"]["Tools"]
    goal = next(tool for tool in tools if tool["Class"].endswith("SetGoal"))
    assert goal["Topic"]["Value"] == "/sain/goal_pose" in heard
    options = yaml.safe_load(VIEW.read_text())["Visualization Manager"]["Global Options"]
    assert options["Fixed Frame"] == "world"


def test_another_namespace_has_a_view_of_its_own():
    assert view_of("/sain", VIEW) == VIEW
    made = view_of("/lab/left", VIEW)
    text = made.read_text()
    made.unlink()
    assert topics_of(text) == {
        t.replace("/sain/", "/lab/left/") for t in topics_of(VIEW.read_text())
    }
    assert values_of("TF Prefix", yaml.safe_load(text)) == ["lab/left"]


class Made(SimpleNamespace):
    """An action, a node or a value, with all that it was made of."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(given=given, **named)

    def perform(self, context: dict[str, str]) -> str:
        return context[self.given[0]]


@pytest.fixture
def launch_file(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The launch file; the wheels lack what it imports."""
    for module, names in STAND_INS.items():
        stand_in = ModuleType(module)
        for name in names:
            setattr(stand_in, name, type(name, (Made,), {}))
        monkeypatch.setitem(sys.modules, module, stand_in)
    path = BRINGUP / "launch" / "closed_loop.launch.py"
    spec = importlib.util.spec_from_file_location("closed_loop_launch", path)
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


def launched(launch_file: ModuleType, **given: str) -> list[Any]:
    (parts,) = launch_file.generate_launch_description().given
    declared = {p.given[0]: p.default_value for p in parts if hasattr(p, "default_value")}
    return parts[-1].function({**declared, **given})


def test_the_launch_file_starts_rviz_only_when_asked(launch_file):
    assert [node.executable for node in launched(launch_file)] == ["graph"]
    _, node = launched(launch_file, rviz="true")
    assert (node.package, node.executable) == ("rviz2", "rviz2")
    assert node.arguments[0] == "-d"
    assert topics_of(Path(node.arguments[1]).read_text()) == topics_of(VIEW.read_text())
    assert node.parameters == [{"use_sim_time": True}]


def test_the_launch_file_gives_the_graph_its_options(launch_file):
    graph, goal = launched(launch_file, gui="true", belief="b.json", goal="0.6 0.1", bag="out")
    words = graph.arguments
    assert read_options(GraphOptions, "graph", words, False).belief == "b.json"
    assert {"--gui", "--record", "--bag=out", "--seed=0"} <= set(words)
    assert goal.arguments == ["0.6", "0.1"]
    with pytest.raises(ValueError, match="'perhaps' is neither true nor false"):
        launched(launch_file, record="perhaps")


def test_the_launch_file_takes_a_robot(launch_file, tmp_path):
    bodies = tmp_path / "bodies.yaml"
    bodies.write_text("bodies: [{shape: disk, radius: 0.08}]")
    given = {
        "robot": "python3 -m my_robot.robot_node",
        "bodies": str(bodies),
        "noise": "0.001,0.01",
    }
    (graph,) = launched(launch_file, **given)
    options = read_options(GraphOptions, "graph", graph.arguments, False)
    assert (options.robot, options.bodies) == (given["robot"], bodies)
    assert options.camera.noise == "0.001,0.01"


def test_the_launch_file_of_the_example_gives_what_this_one_takes(launch_file, monkeypatch):
    example = ROOT / "examples" / "my_robot"
    monkeypatch.syspath_prepend(str(example))
    monkeypatch.setattr(sys.modules["launch.actions"], "IncludeLaunchDescription", Made, False)
    made = runpy.run_path(str(example / "launch" / "my_robot.launch.py"))
    (included,) = made["generate_launch_description"]().given[0]
    assert Path(included.given[0]).name == "closed_loop.launch.py"
    given = dict(included.launch_arguments)
    assert given["robot"] == "ros2 run my_robot robot_node"
    assert len(read_bodies(Path(given["bodies"])).names) == 2
    (graph,) = launched(launch_file, **{**given, "robot": "elsewhere"})
    assert {f"--bodies={given['bodies']}", f"--noise={given['noise']}"} <= set(graph.arguments)
    read_options(GraphOptions, "graph", graph.arguments, False)


def test_the_launch_ends_with_the_graph_and_its_code(launch_file, monkeypatch):
    left = []
    monkeypatch.setattr(launch_file.atexit, "register", lambda *call: left.append(call))
    for code in (0, 137):
        exited = SimpleNamespace(locals=SimpleNamespace(event=SimpleNamespace(returncode=code)))
        (ending,) = launch_file.end(exited)
        assert ending.event.reason == f"the graph ended with exit code {code}"
    assert left == [(launch_file.leave, 137)]
