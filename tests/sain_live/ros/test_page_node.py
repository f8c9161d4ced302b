"""The page's node in a graph of real nodes, and with no graph at all."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray

from sain_core.errors import ErrorCode
from sain_core.ros import codec
from sain_interfaces.msg import Plan
from sain_live.requests import Follow, LoadModel, Pause, Reset, SetParameter
from sain_live.ros import tuning
from sain_live.ros.page_node import PageNode
from sain_live.state import Level, Phase
from sain_model.ros.model_node import ModelNode
from sain_mppi.ros.mppi_node import MppiNode
from sain_sim.ros.sim_node import SimNode
from tests.sain_live.straw import SCENE, free_port
from tests.sain_live.viewer import Viewer

SMALL = {"planner__samples": 64, "planner__rounds": 2, "planner__horizon": 2}


@pytest.fixture
def alone(graph):
    return graph.start(PageNode, port=free_port())


@pytest.fixture
def whole(graph):
    graph.start(SimNode)
    graph.listen("/diagnostics", DiagnosticArray)
    graph.start(ModelNode, model="planar")
    planner = graph.start(MppiNode, **SMALL)
    page = graph.start(PageNode, port=free_port(), scenario="anywhere", seed=2)
    graph.wait(planner.remote._client.service_is_ready, "the model's service")
    state = page.state
    graph.wait(lambda: state.scene and state.scene.episode_id == 2, "the scenario")
    graph.wait(lambda: state.planner and state.model and state.arm, "all about the graph")
    graph.wait(lambda: "anywhere, seed 2" in told(page), "the goal")
    return page


def told(page):
    return "\n".join(line.text for line in page.state.log)


def faults(page):
    return [line.text for line in page.state.log if line.kind is Level.FAULT]


def planner_states(graph):
    """What the planner has said of itself."""
    states = [status for array in graph.heard["/diagnostics"] for status in array.status]
    return [state.message for state in states if "mppi_node" in state.name]


def last_plan(graph):
    """The plan that found the goal reached; the page may hear of it first."""
    graph.wait(lambda: graph.find("plan", status=Plan.REACHED), "the last plan")
    return graph.find("plan", status=Plan.REACHED)[-1]


def drop(page, x, y):
    """Let go of the first goal at a place."""
    body = page.state.aim.poses[0].body
    page.page.goals.drop(body, (x, y, 0.0), (1.0, 0.0, 0.0, 0.0), left=False)


def test_the_loop_is_started_and_ends_at_the_goal(graph, whole):
    assert (whole.state.phase, whole.state.model) == (Phase.PAUSED, "planar")
    whole.steering.send(Follow())
    graph.wait(lambda: whole.state.phase is Phase.REACHED, "the goal")
    state, end = whole.state, last_plan(graph)
    count = len(graph.heard["push"])
    graph.wait(lambda: state.pushes == len(state.curves.distance) - 1 == count, "all pushes")
    graph.wait(lambda: "reached with" in told(whole), "the line")
    graph.wait(lambda: np.isfinite(state.curves.planned[1:]).all(), "all results")
    left = pytest.approx(1e3 * end.goal_distance)
    graph.wait(lambda: state.curves.distance[-1] == left, "the distance after the last push")
    graph.wait(  # they come on two topics
        lambda: np.array_equal(state.result.after, state.scene.disks), "the scene of the result"
    )
    distance = pytest.approx(end.goal_distance)
    graph.wait(lambda: state.judge(state.scene.disks).distance == distance, "the last scene")


def test_a_goal_that_is_dragged_while_the_loop_runs_is_followed(graph, whole):
    drop(whole, 0.55, 0.1)
    graph.wait(lambda: "Start follows it" in told(whole), "the note")
    whole.steering.send(Follow())
    graph.wait(lambda: graph.heard["push"], "a push")
    drop(whole, 0.5, 0.15)
    graph.wait(lambda: whole.state.phase is Phase.REACHED, "the goal")
    distance = pytest.approx(last_plan(graph).goal_distance)
    graph.wait(
        lambda: np.hypot(*(whole.state.scene.disks[1, :2] - (0.5, 0.15))) == distance,
        "the body at the second goal",
    )


def test_pause_ends_the_goal(graph, whole):
    whole.steering.send(Follow())
    graph.wait(lambda: graph.heard["push"], "a push")
    whole.steering.send(Pause())
    graph.wait(lambda: whole.state.phase is Phase.PAUSED, "the pause")
    count = len(graph.heard["push"])
    graph.wait(lambda: len(graph.heard["push_result"]) == count, "the push under way")
    assert not whole.state.followed
    graph.wait(lambda: "goal cancelled" in planner_states(graph), "what the planner says of it")
    assert faults(whole) == []


def test_settings_and_models_are_live_and_refusals_are_told(graph, whole):
    planner = next(node for node in graph.nodes if isinstance(node, MppiNode))
    whole.steering.send(SetParameter("planner.samples", 32))
    graph.wait(lambda: planner.config.planner.samples == 32, "the setting")
    whole.steering.send(SetParameter("planner.samples", 0))
    graph.wait(lambda: "planner.samples = 0" in told(whole), "the refusal")
    assert whole.state.planner["planner.samples"] == 32
    whole.steering.send(LoadModel("identity"))
    graph.wait(lambda: whole.state.model == "identity", "the model")
    whole.steering.send(LoadModel("nothing"))
    graph.wait(lambda: "load nothing:" in told(whole), "the refusal")
    assert whole.state.model == "identity"
    scene, stamp = whole.state.scene, graph.bystander.get_clock().now().to_msg()
    ids = {"episode_id": scene.episode_id, "scene_id": 99}
    message = codec.encode_scene(scene.disks, stamp=stamp, settled=True, **ids)
    graph.push(message, 5, (0.0, 0.0, 0.1))
    assert graph.result(5).error_code == ErrorCode.STALE_SCENE
    graph.wait(lambda: "push refused" in told(whole), "the line")


def test_the_page_says_what_the_graph_waits_for(graph, alone, monkeypatch):
    progress = ["compiling 31 of 40 kernels"]
    monkeypatch.setattr(tuning, "describe_compilation", lambda: progress[0])
    state = alone.state
    graph.wait(lambda: "compiling 31 of 40 kernels" in state.starting, "how far it is")
    alone.steering.send(Follow())
    progress[0] = ""
    graph.start(SimNode)
    graph.wait(lambda: state.starting == "waits for the planner and the model", "who is missing")
    graph.wait(lambda: state.scene, "a scene")
    alone.steering.send(Follow())
    graph.wait(lambda: "not yet: waits for the planner and the model" in told(alone), "a refusal")
    graph.start(ModelNode, model="identity")
    graph.wait(lambda: state.starting == "waits for the planner", "who is missing still")
    graph.start(MppiNode, **SMALL)
    graph.wait(lambda: state.starting == "", "all")
    assert faults(alone) == []


def test_without_a_graph_orders_are_refused_in_words(graph, alone):
    alone.steering.send(Follow())
    alone.steering.send(Reset.draw("push_t", 0))
    alone.steering.send(SetParameter("planner.samples", 3))
    alone.steering.send(LoadModel("planar"))
    for words in ("no scene was seen", "no simulator answers", "no planner", "no model's node"):
        graph.wait(lambda w=words: w in told(alone), words)


def test_a_recording_is_shown_and_cannot_be_steered(graph, alone):
    """Scenes alone are enough: bodies are disks, the goal is what is heard."""
    scenes = graph.bystander.create_publisher(type_of("scene"), "scene", 10)
    graph.wait(lambda: scenes.get_subscription_count() > 0, "the page")
    stamp = graph.bystander.get_clock().now().to_msg()
    ids = {"episode_id": 4, "scene_id": 1, "settled": True}
    scenes.publish(codec.encode_scene(SCENE, stamp=stamp, **ids))
    graph.wait(lambda: alone.state.scene, "the scene")
    graph.aim((0.7, 0.05), 1, tolerance=0.03)
    graph.wait(lambda: alone.state.aim and alone.state.aim.tolerance == 0.03, "the goal")
    viewer = Viewer(alone.config.port)
    viewer.wait(lambda: "/goals/1" in viewer.nodes, "the goal")
    viewer.close()
    alone.steering.send(Follow())
    graph.wait(lambda: "a recording cannot be steered" in told(alone), "the words")


def type_of(topic):
    from tests.graph import HEARD

    return HEARD[topic]
