"""The view for RViz: it names what RViz has and what the graph publishes."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import yaml

from sain_bringup.rviz import view_of
from sain_mppi.commands import mppi_node
from sain_sim.commands import sim_node
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
    "launch.actions": ("DeclareLaunchArgument", "OpaqueFunction"),
    "launch.conditions": ("IfCondition",),
    "launch.substitutions": ("LaunchConfiguration",),
    "launch_ros": (),
    "launch_ros.actions": ("Node",),
    "launch_ros.parameter_descriptions": ("ParameterValue",),
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


def test_the_launch_file_starts_rviz_only_when_asked(launch_file):
    (parts,) = launch_file.generate_launch_description().given
    declared = {
        part.given[0]: part.default_value for part in parts if hasattr(part, "default_value")
    }
    assert declared["rviz"] == "false"
    (opened,) = [p for p in parts if getattr(p, "function", None) and hasattr(p, "condition")]
    assert opened.condition.given[0].given == ("rviz",)
    (node,) = opened.function({"namespace": "/sain"})
    assert (node.package, node.executable) == ("rviz2", "rviz2")
    assert node.arguments[0] == "-d"
    assert topics_of(Path(node.arguments[1]).read_text()) == topics_of(VIEW.read_text())
    assert node.parameters == [{"use_sim_time": True}]
