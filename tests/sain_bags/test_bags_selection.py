"""What is recorded, and how it is asked for."""

import pytest

from sain_bags.metadata import OfferedQos
from sain_bags.selection import RequestedQos, adapt, is_hidden, is_wanted

LATCHED = OfferedQos(durability="transient_local")
LOSSY = OfferedQos(reliability="best_effort")


@pytest.mark.parametrize(
    ("topic", "hidden"),
    [("/sain/scene", False), ("/_hidden", True), ("/a/_b/c", True), ("/a_b", False)],
)
def test_hidden_topics(topic: str, hidden: bool) -> None:
    assert is_hidden(topic) == hidden
    assert is_wanted(topic, ()) == (not hidden)


def test_chosen_topics_are_all_there_is() -> None:
    assert is_wanted("/a/_b", {"/a/_b"})
    assert not is_wanted("/a", {"/a/_b"})


@pytest.mark.parametrize(
    ("offers", "request_"),
    [
        ([OfferedQos()], RequestedQos(reliable=True, transient_local=False)),
        ([LATCHED, LATCHED], RequestedQos(reliable=True, transient_local=True)),
        ([LATCHED, OfferedQos()], RequestedQos(reliable=True, transient_local=False)),
        ([OfferedQos(), LOSSY], RequestedQos(reliable=False, transient_local=False)),
        ([], RequestedQos(reliable=False, transient_local=False)),
    ],
)
def test_the_strongest_request_that_all_publishers_serve(
    offers: list[OfferedQos], request_: RequestedQos
) -> None:
    assert adapt(offers) == request_
