"""A viewer of the live page without a browser: it speaks viser's protocol over a websocket."""

import threading
import time
from collections.abc import Callable
from typing import Any, Final

import msgspec
import viser
import websockets.exceptions
import zstandard
from websockets.sync.client import connect

HEADER: Final = 8  # bytes of each of the two lengths before a message
POLL: Final = 0.01  # [s]
CAMERA: Final = {
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (1.0, 0.0, 1.0),
    "fov": 0.7,
    "near": 0.01,
    "far": 100.0,
    "image_height": 768,
    "image_width": 1024,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}


class Viewer:
    """Keeps what the page sent, and sends what a browser would.

    Attributes:
        nodes: of the scene, by name, with what was last said of each.
        controls: by identity, likewise.
    """

    def __init__(self, port: int, origin: str | None = None) -> None:
        """Open the page on this computer."""
        protocol: Any = f"viser-v{viser.__version__}"
        self._socket = connect(
            f"ws://127.0.0.1:{port}",
            subprotocols=[protocol],
            origin=origin,  # type: ignore[arg-type]
            compression=None,
            max_size=None,
            proxy=None,
        )
        self.nodes: dict[str, dict[str, Any]] = {}
        self.controls: dict[str, dict[str, Any]] = {}
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()
        self.send("ViewerCameraMessage", **CAMERA)

    def send(self, kind: str, **fields: Any) -> None:
        """Send a message."""
        self._socket.send(msgspec.msgpack.encode({"type": kind, **fields}))

    def close(self) -> None:
        """Leave."""
        self._socket.close()
        self._thread.join()

    def wait(self, done: Callable[[], Any], what: str, timeout: float = 20.0) -> None:
        """Wait until something is so."""
        end = time.monotonic() + timeout
        while not done():
            assert time.monotonic() < end, f"waited {timeout} s for {what}"
            time.sleep(POLL)

    def control(self, label: str) -> str:
        """Return the identity of the control with a label."""
        found = [key for key, one in self.controls.items() if one.get("label") == label]
        assert len(found) == 1, f"{len(found)} controls are called {label!r}"
        return found[0]

    def turn(self, label: str, value: Any) -> None:
        """Give a control another value, as a viewer does."""
        self.send("GuiUpdateMessage", uuid=self.control(label), updates={"value": value})

    def drag(self, name: str, *way: tuple[float, float], release: bool = True) -> None:
        """Drag a handle along places [m]."""
        self.send("TransformControlsDragStartMessage", name=name)
        for x, y in way:
            self.send(
                "TransformControlsUpdateMessage",
                name=name,
                position=(x, y, 0.0),
                wxyz=self.nodes[name].get("wxyz", (1.0, 0.0, 0.0, 0.0)),
            )
        if release:
            self.send("TransformControlsDragEndMessage", name=name)

    @property
    def texts(self) -> str:
        """All HTML of the page."""
        return "\n".join(str(one.get("content", "")) for one in list(self.controls.values()))

    def _listen(self) -> None:
        try:
            for raw in self._socket:
                assert isinstance(raw, bytes)
                self._take(raw)
        except websockets.exceptions.ConnectionClosed:
            pass

    def _take(self, raw: bytes) -> None:
        size = int.from_bytes(raw[HEADER : 2 * HEADER], "little")
        packed = raw[2 * HEADER : 2 * HEADER + size]
        messages = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(packed))
        for message in messages["messages"]:
            name, uuid = message.get("name"), message.get("uuid")
            if message["type"] == "RemoveSceneNodeMessage":
                for below in [one for one in self.nodes if f"{one}/".startswith(f"{name}/")]:
                    del self.nodes[below]
            elif name is not None:
                state = self.nodes.setdefault(name, {})
                pose = {k: tuple(v) for k, v in message.items() if k in ("position", "wxyz")}
                state.update(pose)
            elif uuid is not None:
                state = self.controls.setdefault(uuid, {})
                state.update(message.get("props", {}))
                state.update(message.get("updates", {}))
                if "value" in message:
                    state["value"] = message["value"]
