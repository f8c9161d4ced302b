"""The episodes of a simulator: resets, and how one goes on where another process crashed."""

from collections.abc import Sequence
from typing import Any, Final

from rclpy.node import Node

from sain_core import wire
from sain_core.errors import BusyError, CancelledError, SainError
from sain_core.guarding.ros.reception import introspect, shortened
from sain_core.ros.node_main import steady_timer
from sain_core.ros.push_driver import PushDriver
from sain_core.ros.worker import Worker
from sain_core.types import Scene
from sain_interfaces.msg import Push, PushResult
from sain_interfaces.srv import ResetScene
from sain_sim.ros.publishing import Publishing
from sain_sim.ros.resumption import Resumption
from sain_sim.ros.simulator import Simulator
from sain_sim.world.workcell import Sample

LOOK_AGAIN: Final = 0.1  # [s] between looks for those who listened before a crash


class Episodes:
    """Begins episodes, and keeps what it takes to go on from the latest scene."""

    def __init__(
        self,
        node: Node,
        simulator: Simulator,
        worker: Worker,
        publishing: Publishing,
        driver: PushDriver,
    ) -> None:
        """Start the first episode, or go on where another process was left."""
        self._node, self._simulator, self._worker = node, simulator, worker
        self._publishing, self._driver = publishing, driver
        self._publish_result = driver.answer
        config = simulator.config
        self._resumption = Resumption(node, config.state_file, driver.session, simulator.pacer)
        if (request := self._resumption.resume()) is None:
            self._reset(ResetScene.Request(seed=config.seed))
        else:
            publishing.take(self._place(request))
            steady_timer(node, LOOK_AGAIN, self._look_for_listeners)
        service = driver.reception.serve(ResetScene, "reset_scene", self._on_reset)
        introspect(node, service, config.service_introspection)

    @property
    def rests(self) -> bool:
        """Whether nothing happens to the bodies."""
        return not (self._driver.session.busy or self._resumption.waits)

    def check_begun(self) -> None:
        """Raise `BusyError` until all listen again who did before a crash."""
        if self._resumption.waits:
            raise BusyError("the simulator goes on after a crash; send the push anew later")

    def keep(self, push: Push | None = None, unsent: PushResult | None = None) -> None:
        """Keep what it takes to go on from here; with the push that is begun, or its result."""
        scene, friction = self._publishing.sample.scene, self._simulator.parameters.friction
        self._resumption.keep(self._begun, scene, friction, push, unsent)

    def look_around(self) -> None:
        """Note who listens."""
        if not self._resumption.waits:
            self._resumption.look_around()

    def _look_for_listeners(self) -> None:
        """Publish all again, once they listen again, that somebody may not have received."""
        if not self._resumption.waits or not self._resumption.all_listen():
            return
        if (unsent := self._resumption.unsent) is not None:
            self._publish_result(unsent)
        self._announce()
        if (lost := self._resumption.lost) is not None:
            text = f"push {lost.push_id} ended when the simulator crashed; it moved nothing"
            self._driver.answer_refused(lost, CancelledError(text))

    def _on_reset(
        self, request: ResetScene.Request, response: ResetScene.Response
    ) -> ResetScene.Response:
        try:
            self._reset(request)
        except SainError as error:
            self._node.get_logger().warning(f"reset refused: {shortened(str(error))}")
            raise
        finally:
            response.scene = self._publishing.settled
        return response

    def _reset(self, request: ResetScene.Request) -> None:
        self._driver.session.check_idle()
        sample = self._place(request)
        self._driver.session.begin_episode()
        self._publishing.take(sample)
        self._announce()

    def _place(self, request: ResetScene.Request) -> Sample:
        """Bring the world to where a request has it."""
        scene = _bodies(request.disks)
        shapes, roles = tuple(request.shapes), tuple(request.roles)
        given = request.seed, request.world, scene, shapes, request.friction, roles
        self._simulator.pacer.idle()
        sample = self._worker.call(lambda: self._simulator.reset(*given))
        self._begun = request
        return sample

    def _announce(self) -> None:
        """Publish all about an episode from its start."""
        self._resumption.waits = False
        self._publishing.episode(self._begun)
        self.keep()
        self._publishing.settle()


def _bodies(disks: Sequence[Any]) -> Scene | None:
    name = "scene of the reset"
    return wire.check_bodies(wire.decode_disks(disks, name), name) if disks else None
