"""One PyBullet client, and the only way to it.

PyBullet calls without ``physicsClientId`` all talk to client 0, so two worlds in one process
silently become one. A `Client` adds its own id to every call; nothing else imports PyBullet.
"""

import functools
import os
import sys
from typing import Any

from sain_core.errors import ConfigError, SainError
from sain_sim.arm.silence_stderr import muted


class Client:
    """A physics server of our own: ``client.stepSimulation()`` steps this one and no other."""

    def __init__(self, gui: bool = False) -> None:
        """Connect, with a window when asked; PyBullet would end the process without a display.

        Raises:
            ConfigError: a window where there is no display.
            SainError: when PyBullet gives no connection.
        """
        if gui and sys.platform == "linux" and not os.environ.get("DISPLAY"):
            raise ConfigError("gui is true but DISPLAY is not set: there is no screen to show it")
        with muted():
            import pybullet  # here, so that settings and help load without it

        self._pybullet = pybullet
        self.id = pybullet.connect(pybullet.GUI if gui else pybullet.DIRECT)
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
