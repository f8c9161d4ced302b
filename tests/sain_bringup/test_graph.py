"""The processes of the graph; what makes no sense is refused in one line before one starts."""

import os
from dataclasses import replace
from pathlib import Path

import pytest

from sain_bringup.graph import (
    GraphOptions,
    executable,
    graph_commands,
    restart_command,
)
from sain_bringup.ros.closed_loop import ClosedLoopOptions
from sain_core.errors import ConfigError
from sain_core.world import ObservationConfig


@pytest.fixture
def prefix(tmp_path, monkeypatch):
    """An install with the four executables of the graph."""
    for name in (
        "sain_sim/sim_node",
        "sain_model/model_node",
        "sain_mppi/mppi_node",
        "sain_bags/record",
    ):
        path = tmp_path / "lib" / name
        path.parent.mkdir(parents=True)
        path.touch(mode=0o755)
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere{os.pathsep}{tmp_path}")
    return tmp_path


def test_a_policy_in_a_folder_that_is_a_number_is_no_number(prefix, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "20261130").mkdir()
    commands = graph_commands(GraphOptions(policy="20261130"), [], tmp_path)
    assert f"policy:={tmp_path}/20261130" in commands["planner"]


def test_commands_say_it_all(prefix, tmp_path):
    parameters = tmp_path / "p.yaml"
    parameters.write_text("mppi_node: {ros__parameters: {}}")
    played = ClosedLoopOptions(model="planar", seed=7, params_file=parameters)
    graph = replace(played, out=Path("out"))
    given = (["-r", "__ns:=/lab"], tmp_path)
    commands = graph_commands(graph, *given)
    assert list(commands) == ["model", "recorder", "simulator", "planner"]
    for command in commands.values():
        assert "__ns:=/lab" in command
        assert command.count("--ros-args") == 1
    assert "model:=planar" in commands["model"]
    for name in ("model", "planner"):  # all headers have the simulator's time
        assert "use_sim_time:=true" in commands[name]
    assert {"namespace=/lab", "model=planar", "out/bag"} <= set(commands["recorder"])
    assert str(parameters) not in commands["recorder"]
    assert str(parameters) in commands["planner"]
    assert "seed:=7" in commands["planner"]
    for name, node in (("planner", "mppi_node"), ("simulator", "sim_node")):
        assert f"state_file:={tmp_path / node}.json" in commands[name]
    assert "gui:=true" not in commands["simulator"]
    shown = replace(graph, gui=True)
    assert "gui:=true" in graph_commands(shown, *given)["simulator"]
    assert not any("engine" in word for word in commands["simulator"])
    pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    other = replace(graph, engine="mujoco")
    assert "engine:=mujoco" in graph_commands(other, *given)["simulator"]


def test_simulator_planner_and_model_are_told_the_same_of_the_camera(prefix, tmp_path):
    seen = ObservationConfig(noise="0.005,0.035", delay=0.1, unknown="mass")
    commands = graph_commands(GraphOptions(camera=seen), [], tmp_path)
    for name, part in (("simulator", "camera"), ("planner", "estimator")):
        assert f"{part}.noise:=0.005,0.035" in commands[name]
        assert f"{part}.delay:=0.1" in commands[name]
        assert f"{part}.unknown:=mass" in commands[name]
        assert not any("bias" in word for word in commands[name])
    assert "unknown:=mass" in commands["model"]


def test_what_is_not_installed_is_named(prefix):
    assert executable("sain_bags", "record") == prefix / "lib" / "sain_bags" / "record"
    with pytest.raises(ConfigError, match="sain_sim nothing is not installed"):
        executable("sain_sim", "nothing")


ROBOT = "bodies: [{shape: disk, radius: 0.08, mass: 8.0}, {shape: disk, radius: 0.06%s}]\n"


def test_a_driver_takes_the_place_of_the_simulator(tmp_path):
    bodies = tmp_path / "bodies.yaml"
    bodies.write_text(ROBOT % "")
    seen = ObservationConfig(noise="0.001,0.01")
    options = GraphOptions(driver="python3 'my driver.py' -v", bodies=bodies, camera=seen)
    graph = replace(options, record=False)
    commands = graph_commands(graph, ["-r", "__ns:=/lab"], tmp_path)
    assert list(commands) == ["model", "robot", "scenes", "planner"]
    assert commands["robot"] == [
        "python3", "my driver.py", "-v", "--ros-args", "-r", "__ns:=/lab",
    ]  # fmt: skip
    assert {f"bodies:={bodies}", "noise:=0.001,0.01"} <= set(commands["scenes"])
    assert {"estimator.noise:=0.001,0.01", "estimator.unknown:=mass"} <= set(commands["planner"])
    assert "unknown:=mass" in commands["model"]
    assert not any("use_sim_time:=true" in command for command in commands.values())
    assert restart_command("robot", commands["robot"]) == []
    assert restart_command("scenes", commands["scenes"]) == commands["scenes"]
    bodies.write_text(ROBOT % ", mass: 8.0")
    known = graph_commands(replace(graph, driver="elsewhere"), [], tmp_path)
    assert list(known) == ["model", "scenes", "planner"]
    assert "estimator.unknown:=mass" not in known["planner"]


@pytest.mark.parametrize("source", [{"driver": "elsewhere"}, {"faults": "none"}])
def test_a_robot_sees_by_a_camera(tmp_path, source):
    bodies = tmp_path / "bodies.yaml"
    bodies.write_text(ROBOT % ", tags: 1")
    options = GraphOptions(bodies=bodies, see="tags", record=False, **source)
    commands = graph_commands(options, [], tmp_path)
    assert [name for name in commands if name not in ("bench", "robot", "enable")] == [
        "model", "tags", "scenes", "planner",
    ]  # fmt: skip
    assert f"bodies:={bodies}" in commands["tags"]
    assert {f"bodies:={bodies}", "noise:=0.0005,0.005"} <= set(commands["scenes"])
    assert "estimator.noise:=0.0005,0.005" in commands["planner"]
    assert not any("use_sim_time:=true" in command for command in commands.values())


def test_a_robot_is_simulated_with_its_tool(tmp_path):
    commands = graph_commands(GraphOptions(robot="so101", record=False), [], tmp_path)
    assert "cell.robot:=so101" in commands["simulator"]
    assert "feasibility.limits.tool_radius:=0.008" in commands["planner"]
    usual = graph_commands(GraphOptions(record=False), [], tmp_path)
    assert not any("cell.robot" in word for word in usual["simulator"])
    assert not any("tool_radius" in word for word in usual["planner"])


def test_a_bench_is_a_controller_with_faults_a_driver_and_who_enables_it(tmp_path):
    pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    options = GraphOptions(
        robot="so101", engine="mujoco", faults="abort=0.5,every=2", pace=2.0, record=False
    )
    commands = graph_commands(options, ["-r", "__ns:=/lab"], tmp_path)
    assert list(commands) == ["model", "bench", "robot", "enable", "scenes", "planner"]
    given = {"cell.robot:=so101", "engine:=mujoco", "world:=measured", "pace:=2.0"}
    assert given | {"faults:=abort=0.5,every=2", "__ns:=/lab"} <= set(commands["bench"])
    assert any(word.endswith("bodies/so101.yaml") for word in commands["bench"])
    assert "robot:=so101" in commands["robot"]
    assert commands["enable"][1:3] == ["--robot", "so101"]
    assert "enable" not in graph_commands(replace(options, enable=False), [], tmp_path)
    outlines = graph_commands(replace(options, see="outlines"), [], tmp_path)
    assert {"poses:=false", "images.width:=640"} <= set(outlines["bench"])
    assert "scene_timeout:=3.0" in outlines["robot"]
    assert "robot:=so101" in outlines["outlines"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"bodies": Path("b.yaml")}, "--bodies is for a robot; give --driver or --faults, too"),
        ({"driver": "python3", "gui": True}, "--driver replaces the simulator; leave out --gui"),
        ({"driver": "python3", "see": "tags"}, "--see tags needs the bodies of the robot"),
        ({"driver": "python3", "engine": "mujoco"}, "--driver replaces the simulator"),
        ({"driver": "python3", "robot": "ur5"}, "--driver replaces the simulator"),
        ({"driver": "no_such_driver"}, "there is no command 'no_such_driver'"),
        ({"driver": "ur5"}, "'ur5'. To simulate a robot, .*--driver elsewhere and start arm_node"),
        ({"driver": "python3 '"}, "No closing quotation"),
        ({"driver": "python3", "bodies": Path("b.yaml")}, r"bodies file b\.yaml: No such file"),
        ({"robot": "python3 x.py"}, "What starts a driver is given as --driver 'python3 x.py'"),
        ({"robot": "ur6"}, r"robot file ur6: .*shipped are .*ur5"),
        ({"faults": "none", "driver": "python3"}, "leave out --driver, --gui and --bottom"),
        ({"faults": "abbort=1"}, r"'abbort' \(did you mean 'abort'\?\); allowed: none, delay"),
    ],
)
def test_a_robot_that_makes_no_sense(change, message):
    with pytest.raises(ConfigError, match=message):
        GraphOptions(**change)  # type: ignore[arg-type]
