"""The learner of a graph: it hears results, serves what it has learned, and says what it does."""

import numpy as np
import pytest

from sain_core.errors import ConfigError, ErrorCode
from sain_core.ros import codec
from sain_core.ros.qos import LATCHED, QUEUE
from sain_core.wire.learning import decode_learning
from sain_interfaces.msg import Learning, PushResult
from sain_lab.ros.learner_node import LearnerNode
from sain_lab.storage.laboratory import Laboratory, OpenLaboratory
from sain_model.physics.parameters import TEXTBOOK
from sain_model.ros.model_node import ModelNode
from tests.sain_lab.table import SmallTable, plant


def results(count, episode=1, seed=0):
    """Return results of pushes that were made one after the other."""
    table, stamp = SmallTable(seed, TEXTBOOK, 0.0, count), codec.encode_time(0)
    found = []
    for number in range(1, count + 1):
        made, ids = table.push(), {"episode_id": episode, "scene_id": number}
        before, after = (
            codec.encode_scene(scene, stamp=stamp, settled=True, **ids)
            for scene in (made.before, made.after)
        )
        push = codec.encode_push(made.push, stamp=stamp, push_id=number, source="test", **ids)
        found.append(
            PushResult(
                push_id=number, episode_id=episode, error_code=ErrorCode.OK, push=push,
                before=before, after=after,
            )
        )  # fmt: skip
    return found


@pytest.fixture
def sending(graph):
    graph.heard["learning"] = []
    graph.bystander.create_subscription(
        Learning, "learning", graph.heard["learning"].append, LATCHED
    )
    return graph.bystander.create_publisher(PushResult, "push_result", QUEUE)


def send(graph, sending, learner, messages):
    graph.wait(lambda: sending.get_subscription_count() > 1, "the learner")  # and the bystander
    for message in messages:
        sending.publish(message)
    graph.wait(lambda: graph.heard["learning"], "a message of the learner")


def test_what_is_learned_is_served_and_said(graph, sending, tmp_path):
    path = tmp_path / "lab"
    service = graph.start(ModelNode, model="planar")
    learner = graph.start(LearnerNode, nice=0, laboratory=str(path), trains=False)
    first, second = results(5), results(1, episode=2, seed=1)
    send(graph, sending, learner, [*first, *first, *second])  # five come twice
    graph.wait(lambda: graph.heard["learning"][-1].pushes == 6, "six pushes")
    graph.wait(
        lambda: learner._loaded == learner.learner.laboratory.manifest.generation > 0, "a belief"
    )
    graph.wait(lambda: learner._asked.done() and not learner.worker.pending, "the model")
    assert service.server.name == f"lab:{path}"
    learned = decode_learning(graph.heard["learning"][-1])
    assert (learned.laboratory, learned.service, learned.pushes) == ("lab", "physics", 6)
    assert [curve.name for curve in learned.errors] == ["planar", "physics", "in service"]
    friction = next(one for one in learned.parameters if one.name == "tool_friction")
    low, high = friction.values[-1, 1:]
    assert low < TEXTBOOK.tool_friction < high


def test_what_cannot_be_learned_from_is_said(graph, sending, tmp_path):
    learner = graph.start(LearnerNode, nice=0, laboratory=str(tmp_path / "lab"), trains=False)
    first, _, second = results(3)  # begins elsewhere than where the first one led
    invalid, refused = results(2, episode=7)
    invalid.after.disks[0].x = np.nan
    refused.error_code = int(ErrorCode.BLOCKED)
    send(graph, sending, learner, [invalid, refused, first, second])
    graph.wait(lambda: graph.heard["learning"][-1].events, "an event")
    last = decode_learning(graph.heard["learning"][-1])
    assert last.pushes == 1
    ((_, kind, text),) = last.events
    assert kind == "not learned" and "somebody moved it" in text


def test_the_switch_stops_the_learning(graph, sending, tmp_path):
    learner = graph.start(LearnerNode, nice=0, laboratory=str(tmp_path / "lab"), learns=False)
    send(graph, sending, learner, results(2))
    graph.spin(1.0)
    assert learner.learner.state.pushes == 0


def test_a_network_that_got_worse_is_dropped_and_that_is_said(graph, sending, tmp_path):
    path, service = tmp_path / "lab", "models/000001"
    with OpenLaboratory(path) as laboratory:
        plant(laboratory.model_path(service))
        about = {"service": service}
        event = {"event": "loaded", "text": "planted", "pushes": 0, "time": 0.0, "about": about}
        laboratory.append({"kind": "event", **event})
        laboratory.state(service=service)
    learner = graph.start(LearnerNode, nice=0, laboratory=str(path), trains=False)
    assert learner.learner.state.judge.service == service
    send(graph, sending, learner, results(30))
    graph.wait(lambda: not learner.worker.pending, "all pushes")
    graph.wait(lambda: graph.heard["learning"][-1].service in ("physics", "shipped"), "the drop")
    texts = [event.text for event in graph.heard["learning"][-1].events]
    assert any(text.endswith(f"errs less than {service}") for text in texts)
    assert Laboratory(path).manifest.service in ("physics", "shipped")


def test_a_laboratory_needs_a_name(graph):
    with pytest.raises(ConfigError, match="laboratory is empty; give a name"):
        graph.start(LearnerNode)
