"""The settings of the page."""

import errno
import ipaddress
import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sain_core.config import MOST_SEED, Config, FieldSetting, option, settings_of
from sain_core.errors import BusyError, ConfigError
from sain_eval.scenes.scenarios import check_scenario
from sain_mppi.config import PlannerConfig

NO_SCENARIO: Final = ""
NO_BAG: Final = ""


@dataclass(frozen=True)
class PageConfig(Config):
    """Where the page is served, and what it begins with."""

    host: str = option(
        "127.0.0.1", "address to listen at; 0.0.0.0: any computer may open the page and steer"
    )
    port: int = option(8080, "port to listen at", minimum=1, maximum=65535)
    scenario: str = option(
        NO_SCENARIO, "scenario to reset the scene to, once the simulator is there; empty: leave it"
    )
    outlines: str = option("", "file of outlines with the bodies of `anything`; empty: your own")
    seed: int = option(0, "of that scene", minimum=0, maximum=MOST_SEED)
    bag: str = option(
        NO_BAG, "folder of a recording to play, in place of the graph; empty: the graph"
    )
    speed: float = option(
        1.0, "of a recording: simulated time / playing time", minimum=1e-3, maximum=1e3
    )
    loop: bool = option(True, "begin a recording again at its end")
    rate: float = option(
        40.0, "most updates sent to each viewer", unit="Hz", minimum=1.0, maximum=60.0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.scenario != NO_SCENARIO:
            check_scenario(self.scenario, self.outlines_file)

    @property
    def outlines_file(self) -> Path | None:
        """The file of outlines; None: the user's own."""
        return Path(self.outlines) if self.outlines else None

    @property
    def address(self) -> str:
        """The address to type into a browser on this computer."""
        host = "127.0.0.1" if self.host in ("0.0.0.0", "") else self.host
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}"


def planner_settings() -> list[FieldSetting]:
    """Return the planner's settings by the names of its parameters, those of its groups last."""
    return sorted(settings_of(PlannerConfig(), "planner."), key=lambda one: one.name.count("."))


def check_free(host: str, port: int) -> None:
    """Check that the page can be served at an address.

    Raises:
        BusyError: another program listens there.
        ConfigError: this computer has no such address.
    """
    try:
        stream, passive = socket.SOCK_STREAM, socket.AI_PASSIVE
        found = socket.getaddrinfo(host or None, port, type=stream, flags=passive)
        family, _, _, _, where = found[0]
        socket.create_server(where[:2], family=family, backlog=1).close()
    except PermissionError as error:
        raise ConfigError(
            f"port {port} is reserved for the system; choose one above 1023, for example port 8081"
        ) from error
    except OSError as error:
        if isinstance(error, socket.gaierror) or error.errno == errno.EADDRNOTAVAIL:
            raise ConfigError(
                f"host is {host!r}; this computer has no such address: use 127.0.0.1, or 0.0.0.0"
                " for all computers"
            ) from error
        raise BusyError(
            f"port {port} of {host} is in use by another program; stop it, or choose another"
            f" port, for example {port + 1 if port < 65535 else 8081}"
        ) from error


def is_loopback(host: str) -> bool:
    """Tell whether an address can be reached from this computer only."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
