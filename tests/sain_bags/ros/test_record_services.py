"""Service calls are recorded where introspection is on, and can be read without ROS."""

from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from sain_bags.ros.record import drain
from sain_bags.ros.recorder import Recorder
from sain_bags.writing.selection import Selection
from sain_bags.writing.writer import BagWriter
from sain_core.errors import ErrorCode
from sain_interfaces.srv import DescribeModel
from sain_model.ros.model_node import ModelNode

pytestmark = pytest.mark.ros
EVENTS = "/sain/describe_model/_service_event"
TYPE = "sain_interfaces/srv/DescribeModel_Event"


@pytest.fixture
def recorded(graph: Any, tmp_path: Path) -> Path:
    """A bag of a model's node that was asked once for its description."""
    graph.start(ModelNode, model="planar", service_introspection="contents")
    with BagWriter(tmp_path / "bag") as writer:
        recorder = Recorder(writer, Selection(), context=graph.context)

        def listens() -> bool:
            recorder.work()
            return bool(graph.bystander.count_subscribers(EVENTS))

        graph.wait(listens, "a recorder of service events")
        graph.call(DescribeModel, "describe_model", DescribeModel.Request())

        def is_recorded() -> bool:
            recorder.work()
            return writer.counts[EVENTS] >= 2

        graph.wait(is_recorded, "a recorded call")
        drain(recorder)
        recorder.destroy_node()
    return tmp_path / "bag"


def test_a_call_is_decoded_from_the_definitions_inside(recorded: Path) -> None:
    with AnyReader([recorded]) as reader:  # opens it, whatever else is in it
        (events,) = [found for found in reader.connections if found.topic == EVENTS]
        assert events.msgtype == TYPE
        raw = [data for _, _, data in reader.messages([events])]
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(events.msgdef.data, TYPE))
    asked, answered = (
        store.deserialize_cdr(data, "sain_interfaces/srv/msg/DescribeModel_Event") for data in raw
    )
    assert (asked.info.event_type, answered.info.event_type) == (1, 2)  # received, and sent
    assert asked.info.sequence_number == answered.info.sequence_number
    assert (len(asked.request), len(asked.response)) == (1, 0)
    (response,) = answered.response
    assert response.error_code == ErrorCode.OK
    assert (response.model, response.kind) == ("planar", "physics")


def test_nothing_is_published_unless_it_is_asked_for(graph: Any) -> None:
    graph.start(ModelNode, model="planar")
    graph.call(DescribeModel, "describe_model", DescribeModel.Request())
    names = {name for name, _ in graph.bystander.get_topic_names_and_types()}
    assert "/sain/plan" in names
    assert EVENTS not in names
