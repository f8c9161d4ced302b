"""One PyBullet client, and the only way to it.

PyBullet calls without ``physicsClientId`` all go to client 0, so two worlds in one process would
be one without an error. A `Client` adds its own id to every call; nothing else imports PyBullet.
"""

import functools
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from sain_core.errors import SainError


@contextmanager
def silence_stderr() -> Iterator[None]:
    """Discard what C code writes to standard error: PyBullet prints its build time on import."""
    saved, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(nowhere)


class Client:
    """A physics server of our own: ``client.stepSimulation()`` steps this one and no other."""

    def __init__(self) -> None:
        """Connect.

        Raises:
            SainError: when PyBullet gives no connection.
        """
        with silence_stderr():
            import pybullet  # here, so that settings and help load without it

        self._pybullet = pybullet
        self.id = pybullet.connect(pybullet.DIRECT)
        if self.id < 0:
            raise SainError("PyBullet refused a connection")

    def __getattr__(self, name: str) -> Any:
        """Return PyBullet's function of this name bound to this client, or its constant."""
        value = getattr(self._pybullet, name)
        if callable(value):
            value = functools.partial(value, physicsClientId=self.id)
        self.__dict__[name] = value
        return value

    def close(self) -> None:
        """Disconnect; doing it twice is fine."""
        if self.id >= 0:
            self._pybullet.disconnect(physicsClientId=self.id)
            self.id = -1
