"""Messages are decoded as `rosbags` decodes them, of whatever type; no bytes hang a decoder."""

import os
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from sain_bags.bag.definitions import Definitions
from sain_bags.bag.layouts import Decoder
from sain_bags.bag.message_types import read_types
from sain_core.errors import DatasetError
from sain_core.randomness import generator

ARRAYS = {"bool": "bool_", "byte": "uint8", "char": "uint8", "octet": "uint8"}


def drawn(store: Any, description: Any, random: np.random.Generator) -> Any:
    """Return a random value of a field, as `rosbags` has it."""
    node, about = description
    if node == Nodetype.NAME:
        fields = store.fielddefs[about][1]
        return store.types[about](**{name: drawn(store, kind, random) for name, kind in fields})
    if node == Nodetype.BASE:
        number = int(random.integers(2 if about[0] == "bool" else 100))
        return {"string": "ä" * number, "bool": bool(number)}.get(
            about[0], float(number) if "float" in about[0] else number
        )
    inner, count = about
    size = count if node == Nodetype.ARRAY else int(random.integers(3))
    values = [drawn(store, inner, random) for _ in range(size)]
    if inner[0] == Nodetype.BASE and inner[1][0] != "string":
        return np.array(values, ARRAYS.get(inner[1][0], inner[1][0]))
    return values


def same(one: Any, other: Any, store: Any) -> bool:
    if (kind := getattr(other, "__msgtype__", None)) is not None:
        names = [name for name, _ in store.fielddefs[kind][1]]
        return all(same(getattr(one, name), getattr(other, name), store) for name in names)
    if isinstance(other, list):
        return len(one) == len(other) and all(same(*pair, store) for pair in zip(one, other))  # noqa: B905
    return list(one) == other.tolist() if isinstance(other, np.ndarray) else bool(one == other)


def test_installed_types_are_decoded_as_rosbags_does() -> None:
    definitions, random = Definitions(), generator(3)
    shares = [Path(prefix, "share") for prefix in os.environ["AMENT_PREFIX_PATH"].split(":")]
    files = [path for share in shares for path in share.glob("*/msg/*.msg")]
    names = sorted({f"{path.parent.parent.name}/msg/{path.stem}" for path in files})
    assert len(names) > 100
    for name in names[::7]:  # `rosbags` takes a while for each
        text, store = definitions.joined(name), get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(text, name))
        decoder = Decoder(read_types(name, text), name)
        message = drawn(store, (Nodetype.NAME, name), random)
        for little in (True, False):
            data = bytes(store.serialize_cdr(message, name, little_endian=little))
            assert same(decoder.decode(data), message, store), name


def test_any_bytes_are_decoded_or_refused() -> None:
    random, name = generator(4), "visualization_msgs/msg/MarkerArray"
    decoder = Decoder(read_types(name, Definitions().joined(name)), name)
    for _ in range(300):
        size = int(random.integers(2000))
        data = b"\0\1\0\0" + bytes(random.choice([0, 0, 0, 1, 2, 255], size).astype(np.uint8))
        try:
            decoder.decode(data)
        except (DatasetError, UnicodeDecodeError):
            continue
