"""The parameter ``bodies``: a YAML file, which may be replaced while a node runs."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from rclpy.node import Node

from sain_core.config import Config
from sain_core.errors import ConfigError
from sain_core.shapes.body_file import BodyFile, read_bodies

C = TypeVar("C", bound=Config)


def read_body_file(path: str) -> BodyFile:
    """Return the bodies that the file of a parameter states; raises `ConfigError`."""
    if not path:
        raise ConfigError("parameter 'bodies' is empty; give the YAML file of the bodies")
    return read_bodies(Path(path).expanduser())


def followed(node: Node, use: Callable[[C], None]) -> Callable[[C], None]:
    """Return what uses changed settings; of a file that cannot be used the reason is logged."""

    def follow(config: C) -> None:
        try:
            use(config)
        except ConfigError as error:
            node.get_logger().error(f"the bodies stay as they are: {error}")

    return follow
