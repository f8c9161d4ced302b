"""What is recorded, and how it is asked for."""

import pytest

from sain_bags.bag.metadata import TopicQos
from sain_bags.writing.selection import Selection, adapt, is_hidden

LATCHED = TopicQos(durability="transient_local")
LOSSY = TopicQos(reliability="best_effort")


@pytest.mark.parametrize(
    ("topic", "hidden"),
    [("/sain/scene", False), ("/_hidden", True), ("/a/_b/c", True), ("/a_b", False)],
)
def test_hidden_topics(topic: str, hidden: bool) -> None:
    assert is_hidden(topic) == hidden
    assert Selection().wants(topic) == (not hidden)
    assert Selection(hidden=True).wants(topic)


def test_chosen_topics_are_all_there_is() -> None:
    assert Selection({"/a/_b"}).wants("/a/_b")
    assert not Selection({"/a/_b"}).wants("/a")
    assert not Selection({"/a/_b"}, hidden=True).wants("/a")
    assert not Selection({"/a/_b"}).wants("/sain/rollout/_service_event")


@pytest.mark.parametrize(
    ("offers", "request_"),
    [
        ([TopicQos()], ("reliable", "volatile")),
        ([LATCHED, LATCHED], ("reliable", "transient_local")),
        ([LATCHED, TopicQos()], ("reliable", "volatile")),
        ([TopicQos(), LOSSY], ("best_effort", "volatile")),
        ([], ("best_effort", "volatile")),
    ],
)
def test_the_strongest_request_that_all_publishers_serve(
    offers: list[TopicQos], request_: tuple[str, str]
) -> None:
    found = adapt(offers)
    assert (found.reliability, found.durability) == request_


def test_images_are_recorded_only_where_asked_for():
    types = ["sensor_msgs/msg/Image"]
    assert not Selection().wants("/camera", types)
    assert Selection(images=True).wants("/camera", types)
    assert Selection({"/camera"}).wants("/camera", types)
