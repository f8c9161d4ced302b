"""The graph with its page, as one command starts it."""

from sain_bringup.graph import (
    GraphOptions,
    executable,
    graph_commands,
    restart_command,
    ros_arguments,
)
from sain_live.live import LiveOptions


def test_the_live_page_is_part_of_its_graph(tmp_path):
    options = LiveOptions(scenario="box", seed=4, port=8123, world="rough", real_time_factor=2.0)
    commands = graph_commands(options, ros_arguments([]), tmp_path)
    assert commands["page"][0] == str(executable("sain_live", "page_node"))
    given = {"host:=127.0.0.1", "port:=8123", "seed:=4", "scenario:=box", "__ns:=/sain"}
    assert given <= set(commands["page"])
    simulator = {"world:=rough", "real_time_factor:=2.0", "cell.full_motion:=true"}
    assert simulator <= set(commands["simulator"])
    assert "page" not in graph_commands(GraphOptions(), [], tmp_path)


def test_a_page_that_crashed_does_not_reset_the_scene():
    assert restart_command("page", ["page_node"])[-1] == "scenario:=''"
