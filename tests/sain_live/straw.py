"""A page without a graph: what it knows is made up, and its orders are only written down."""

import socket
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

import numpy as np

from sain_core.goal import BodyPose, Goal
from sain_core.scene import make_scene
from sain_core.shapes.bodies import Bodies
from sain_core.wire.scene_door import SeenScene
from sain_live.page.live_page import LivePage
from sain_live.settings import PageConfig
from sain_live.state import LiveState

SCENE = make_scene(
    np.array([(0.45, 0.1), (0.6, -0.2)]), np.array([1.0, 1.0]), np.array([0.1, 0.08])
)
BODIES = Bodies.named(["t", "disk"], ["pushable", "fixed"])
AIM = Goal((BodyPose(0, 0.5, 0.2, 0.5),))


class Written:
    """Orders, as they were given."""

    def __init__(self) -> None:
        self.given: list[tuple[Any, ...]] = []

    def __getattr__(self, name: str) -> Any:
        return lambda *values: self.given.append((name, *values))

    def of(self, name: str) -> list[tuple[Any, ...]]:
        return [order[1:] for order in self.given if order[0] == name]


def free_port() -> int:
    with closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def made_up() -> LiveState:
    return LiveState(scene=SeenScene(SCENE, 1, 1), bodies=BODIES, aim=AIM)


@contextmanager
def served(known: LiveState, orders: Any, **settings: Any) -> Iterator[LivePage]:
    page = LivePage(known, orders, PageConfig(port=free_port(), **settings))
    known.changed.set()
    try:
        yield page
    finally:
        page.close()
