"""``ros2 run sain_bags view``: a bag in the live page, which is another package's."""

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import tyro
from rich.console import Console

from sain_bags.reading.reader import BAG_HELP, Bag
from sain_core.cli.command_line import command_of_node
from sain_core.config import Config, option, required

NAME: Final = "recording_page"  # beside a running graph and its page


@dataclass(frozen=True)
class ViewOptions(Config):
    """Play a bag in the live page, with a timeline, until Ctrl-C; the page's address is printed.

    Nothing is published, so a graph may run beside it.
    """

    bag: tyro.conf.Positional[Path] = required(BAG_HELP)
    rate: float = option(1.0, "simulated time / playing time", minimum=1e-3, maximum=1e3)
    host: str = option("127.0.0.1", "address to listen at; 0.0.0.0: open to other computers")
    port: int = option(8080, "port to listen at", minimum=1, maximum=65535)
    loop: bool = option(True, "begin again at the end")


def run(options: ViewOptions, console: Console) -> None:
    """Become the live page of a bag."""
    path = Bag(options.bag).path.resolve()
    command = page_command(options, path)
    os.execv(command[0], command)


def page_command(options: ViewOptions, bag: Path) -> list[str]:
    """Return what serves a bag; raises `ConfigError` where it is not installed."""
    given = {
        "bag": json.dumps(str(bag), ensure_ascii=False),
        "speed": options.rate,
        "loop": str(options.loop).lower(),
        "host": options.host,
        "port": options.port,
    }
    return command_of_node("sain_live", "page_node", ["-r", f"__node:={NAME}"], **given)
