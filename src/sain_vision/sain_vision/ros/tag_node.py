"""The node that finds tags: images in, poses of bodies with covariance out."""

from typing import Any

from sensor_msgs.msg import Image

from sain_core.errors import ConfigError
from sain_vision.detection.tags import TagFinder, TagLocator
from sain_vision.optics import CameraModel
from sain_vision.ros.body_parameter import read_body_file
from sain_vision.ros.images import decode_grey
from sain_vision.ros.settings import COLOUR_TOPICS, TagNodeConfig
from sain_vision.ros.sighting_node import Found, SightingNode


class TagNode(SightingNode):
    """Publishes the bodies whose tags an image shows."""

    settings, topics = TagNodeConfig, COLOUR_TOPICS
    what, overlay = "tags", "camera/overlay"
    config: TagNodeConfig

    def __init__(self, **options: Any) -> None:
        super().__init__("tag_node", **options)
        family, count = self.config.tags.family, sum(map(len, self.bodies.tags))
        self.finder = TagFinder(self.config.tags)
        self.ready = f"{count} tags of {family} on {len(self.bodies.names)} bodies"

    def use(self, config: TagNodeConfig) -> None:
        """Look for the tags of the bodies that a file states."""
        bodies = read_body_file(config.bodies)
        if not any(bodies.tags):
            raise ConfigError(f"no body in {config.bodies} has tags; give 'tags' to one of them")
        self.config, self.bodies = config, bodies
        self.locator = TagLocator(bodies, config.tags)

    def find(self, message: Image, camera: CameraModel) -> Found:
        """Find tags, and the bodies that carry them."""
        grey = decode_grey(message)
        sightings, problems = self.locator.locate(self.finder.find(grey), camera)
        problems += self.finder.problems
        if self.finder.problems:
            self.get_logger().warning("; ".join(self.finder.problems), once=True)
        return sightings, problems, lambda: grey
