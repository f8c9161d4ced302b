"""Parameters are made from dataclasses, and nothing that was given is ignored."""

import os
from dataclasses import dataclass, field

import pytest
from rcl_interfaces.msg import ParameterType
from rclpy.node import Node
from rclpy.parameter import Parameter

from sain_core.config import Config, live_group, option
from sain_core.errors import ConfigError
from sain_core.ros.parameters import LiveParameters, check_parameter_files, read_parameters


@dataclass(frozen=True)
class Tool(Config):
    radius: float = option(0.012, "radius of the stick", unit="m", minimum=0.001, maximum=0.05)
    widths: tuple[float, ...] = option((0.1, 0.2), "widths", unit="m", minimum=0.0)
    names: tuple[str, ...] = option((), "names")
    span: tuple[float, float] = option((0.1, 0.2), "span", unit="m")


@dataclass(frozen=True)
class Settings(Config):
    samples: int = option(64, "K, sequences", minimum=1)
    world: str = option("rough", "which world", choices=("rough", "smooth"))
    gui: bool = option(False, "open a window")
    tool: Tool = field(default_factory=Tool)


@dataclass(frozen=True)
class Motor(Config):
    speed: float = option(1.0, "speed", unit="m/s", minimum=0.0, maximum=2.0)
    mode: str = option("slow", "mode", choices=("slow", "fast"))


@dataclass(frozen=True)
class LiveSettings(Config):
    name: str = option("one", "name")
    gain: float = option(1.0, "gain", live=True)
    motor: Motor = live_group(Motor())


@pytest.fixture
def read(graph):
    def read(**overrides):
        given = [Parameter(k.replace("__", "."), value=v) for k, v in overrides.items()]
        node = graph.add(Node("subject", context=graph.context, parameter_overrides=given))
        return node, read_parameters(node, Settings)

    return read


def test_overrides_reach_nested_settings_and_integers_will_do_for_numbers(read):
    node, settings = read(samples=8, tool__radius=0.02, tool__widths=[1, 2], gui=True)
    assert settings == Settings(samples=8, gui=True, tool=Tool(radius=0.02, widths=(1.0, 2.0)))
    assert node.get_parameter("tool.radius").type_ == Parameter.Type.DOUBLE
    assert isinstance(read(tool__widths=[1, 2])[1].tool.widths[0], float)


def test_each_parameter_says_what_it_is(read):
    node, _ = read()
    radius = node.describe_parameter("tool.radius")
    assert radius.description == "radius of the stick [m]"
    assert radius.read_only
    bounds = radius.floating_point_range[0]
    assert (bounds.from_value, bounds.to_value) == (0.001, 0.05)
    assert node.describe_parameter("samples").integer_range[0].from_value == 1
    assert node.describe_parameter("world").additional_constraints == (
        "one of rough, smooth; read at the start: start the node anew to change it"
    )
    assert node.describe_parameter("gui").type == ParameterType.PARAMETER_BOOL


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"sample": 3}, "parameter 'sample' is unknown; near it: samples"),
        ({"radius": 0.1}, "parameter 'radius' is unknown; near it: tool.radius"),
        ({"tool__radios": 0.1}, "parameter 'tool.radios' is unknown; near it: tool.radius"),
        ({"zzz": 1}, "parameter 'zzz' is unknown; near it: gui, samples, tool.names"),
        ({"samples": True}, "parameter 'samples' is True; it must be an integer"),
        ({"tool__radius": float("nan")}, "parameter 'tool.radius' is nan; it must be finite"),
        ({"tool__radius": 0.1}, "parameter 'tool.radius' is 0.1 m; it must be at most 0.05 m"),
        ({"world": "mars"}, "parameter 'world' is 'mars'; allowed: 'rough', 'smooth'"),
        ({"tool__radius": "thin"}, "parameter 'tool.radius' is 'thin'; it must be a number"),
        ({"gui": 1}, "parameter 'gui' is 1; it must be true or false"),
        ({"tool__span": [0.1]}, "parameter 'tool.span' has 1 values; it must have 2"),
        ({"tool__widths": 0.1}, "parameter 'tool.widths' is 0.1; it must be a list"),
    ],
)
def test_what_is_wrong_is_named(read, overrides, message):
    with pytest.raises(ConfigError, match=f"^{message}"):
        read(**overrides)


def test_live_parameters_are_followed_and_others_refused(graph):
    node = graph.add(Node("subject", context=graph.context))
    used = []
    LiveParameters(node, read_parameters(node, LiveSettings), used.append)
    for values, refusal in (
        ({"motor.speed": 1.5}, ""),
        ({"motor.mode": "fast", "gain": 2.0}, ""),
        ({"motor.mode": "idle"}, "parameter 'motor.mode' is 'idle'; allowed: 'slow', 'fast'"),
        ({"motor.speed": 3.0}, "Parameter motor.speed out of range Min: 0.0, Max: 2.0, value: 3.0"),
        ({"name": "two"}, "Trying to set a read-only parameter: name."),
        ({"gain": 2.0}, ""),
    ):
        given = [Parameter(name, value=value) for name, value in values.items()]
        result = node.set_parameters_atomically(given)
        assert (result.successful, result.reason) == (not refusal, refusal)
    assert used == [
        LiveSettings(motor=Motor(1.5)),
        LiveSettings(gain=2.0, motor=Motor(1.5, "fast")),
    ]


def test_a_fifo_is_refused_and_no_file_is_left_to_rcl(tmp_path):
    fifo, good = tmp_path / "fifo", tmp_path / "good.yaml"
    os.mkfifo(fifo)
    good.write_text("{}")
    with pytest.raises(ConfigError, match="it is a FIFO"):
        check_parameter_files(["--ros-args", "--params-file", str(fifo)])
    check_parameter_files(["--ros-args", "--params-file", str(good)])
    check_parameter_files(["--ros-args", "--params-file", str(tmp_path / "none")])
