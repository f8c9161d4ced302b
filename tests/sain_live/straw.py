"""A page without a graph: what it knows is made up, and its requests are only kept."""

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


class Requests(list[Any]):
    """Requests, as they were sent."""

    def of(self, kind: type) -> list[Any]:
        return [request for request in self if isinstance(request, kind)]


def free_port() -> int:
    with closing(socket.socket()) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def made_up() -> LiveState:
    return LiveState(scene=SeenScene(SCENE, 1, 1), bodies=BODIES, aim=AIM)


@contextmanager
def served(state: LiveState, send: Any, **settings: Any) -> Iterator[LivePage]:
    page = LivePage(state, send, PageConfig(port=free_port(), **settings))
    state.changed.set()
    try:
        yield page
    finally:
        page.close()
