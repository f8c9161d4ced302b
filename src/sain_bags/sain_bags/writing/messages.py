"""Messages made and serialized by `rosbags`, so that bags are written without a running graph."""

from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from sain_bags.bag.definitions import Definitions, referred_types
from sain_bags.bag.metadata import Topic, TopicQos


class MessageMaker:
    """Makes messages of any installed type by their full names, as ``std_msgs/msg/Header``."""

    def __init__(self) -> None:
        self.definitions = Definitions()
        self.store = get_typestore(Stores.ROS2_JAZZY)

    def make(self, type_name: str, /, **fields: Any) -> Any:
        """Return a message; what is not given is zero or empty.

        Raises `InvalidInputError`: its definition is not installed.
        """
        kind = self._kind(type_name)
        values = {
            name: fields[name] if name in fields else self._zero(annotation)
            for name, annotation in kind.__annotations__.items()
            if name != "__msgtype__" and not annotation.startswith("ClassVar")
        }
        return kind(**values)

    def data(self, message: Any) -> bytes:
        """Return a message in CDR."""
        return bytes(self.store.serialize_cdr(message, message.__msgtype__))

    def topic(
        self, name: str, type_name: str, offered_qos: tuple[TopicQos, ...] = (TopicQos(),)
    ) -> Topic:
        """Describe a topic as the recorder does."""
        self._kind(type_name)
        definition = self.definitions.joined(type_name)
        return Topic(name, type_name, definition, self.store.hash_rihs01(type_name), offered_qos)

    def _kind(self, type_name: str) -> Any:
        """Return the class of a type, which is registered with all that it refers to."""
        if type_name not in self.store.types:
            text = self.definitions.text(type_name)
            for name in referred_types(type_name, text):
                self._kind(name)
            self.store.register(get_types_from_msg(text, type_name))
        return self.store.types[type_name]

    def _zero(self, annotation: str) -> Any:
        name = annotation.rpartition(".")[2].rstrip("]").strip("'\"")
        if "ndarray" in annotation:
            return np.zeros(0)
        if annotation.startswith("list"):
            return []
        if "__" in name:
            return self.make(name.replace("__", "/"))
        return {"str": "", "bool": False, "float": 0.0}.get(annotation, 0)
