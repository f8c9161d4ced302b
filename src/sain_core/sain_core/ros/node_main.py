"""The main of every node: start, spin, stop, and an exit code that says how it went."""

import logging
import os
import re
import sys
from collections.abc import Callable
from typing import NoReturn

import rclpy
from rclpy.exceptions import ROSInterruptException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.utilities import ok, try_shutdown

from sain_core.errors import SainError

NAMESPACE = "sain"
"""Where nodes live unless ``--ros-args -r __ns:=/other`` says otherwise."""

RCL_SOURCE = re.compile(r", at /\S+:\d+")
"""Where in its own source an error of rcl was raised: of no use to who reads it."""

INTERRUPTS = (KeyboardInterrupt, ExternalShutdownException, ROSInterruptException)


def run_node(make_node: Callable[[], Node], name: str, args: list[str] | None = None) -> int:
    """Run a node until it is interrupted; return the process's exit code.

    What is wrong with the settings or the start is told in one line on standard error: 1. An
    error later on is a defect and leaves its traceback.
    """
    try:
        rclpy.init(args=args)
    except RuntimeError as error:  # the base of rcl's own errors, which rclpy does not export
        return refuse_start(name, error)
    node = None
    executor = SingleThreadedExecutor()
    try:
        node = make_node()
        executor.add_node(node)
        executor.spin()
    except INTERRUPTS:
        pass
    except SainError as error:
        return refuse_start(name, error)
    except Exception:
        if ok():
            raise
        # A signal that comes during the start invalidates what is being made: rcl raises.
    finally:
        if node is not None:
            node.destroy_node()
        executor.shutdown()
        try_shutdown()
    return 0


def node_main(make_node: Callable[[], Node], name: str) -> NoReturn:
    """Run a node as a process, and end that process.

    Once the node has let go of everything, the interpreter is not taken down piece by piece:
    with PyTorch loaded that takes a second and more, and whoever said Ctrl-C waits for it.
    """
    code = run_node(make_node, name)
    logging.shutdown()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def refuse_start(name: str, error: BaseException) -> int:
    """Say in one line on standard error why a process cannot start; return its exit code."""
    told = " ".join(str(error).split()) or repr(error)
    sys.stderr.write(f"{name}: {RCL_SOURCE.sub('', told)}\n")
    return 1
