"""A client that asks the model's node for single pushes in a batch: for `benchmarks.inference`."""

import time
from typing import Self

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from sain_core import wire
from sain_core.errors import ErrorCode
from sain_core.ros import codec
from sain_core.ros.qos import SERVICE
from sain_core.types import Pushes, Scenes
from sain_interfaces.srv import PredictResidual

PATIENCE_S = 120.0


class Asker:
    """Asks the same again and again, from arrays to arrays."""

    def __init__(self, scenes: Scenes, pushes: Pushes) -> None:
        """Ask about pushes (B, 5) from scenes (B, N, 8)."""
        self.scenes, self.pushes = scenes, pushes
        rclpy.init()
        self.node = Node("asker", namespace="sain")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.client = self.node.create_client(
            PredictResidual, "predict_residual", qos_profile=SERVICE
        )

    def __enter__(self) -> Self:
        if not self.client.wait_for_service(PATIENCE_S):
            raise TimeoutError("no model node")
        return self

    def __exit__(self, *_: object) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown()

    def ask(self) -> Scenes:
        """Encode, ask, wait and decode; return the next scenes (B, N, 8)."""
        batch, disks, _ = self.scenes.shape
        request = PredictResidual.Request(batch=batch, disks=disks)
        request.scenes = codec.encode_floats(self.scenes)
        request.pushes = codec.encode_floats(self.pushes)
        future = self.client.call_async(request)
        end = time.monotonic() + PATIENCE_S
        while not future.done():
            if time.monotonic() > end:
                raise TimeoutError("no answer")
            self.executor.spin_once(timeout_sec=1.0)
        response = future.result()
        if response.error_code != ErrorCode.OK:
            raise RuntimeError(response.error_message)
        wire.decode_floats(response.residual, self.scenes.shape, "residual")
        return np.asarray(wire.decode_floats(response.next_state, self.scenes.shape, "next_state"))
