"""``ros2 run sain_bags view``: a bag in the live page, which is another package's."""

import json
import os
from pathlib import Path
from typing import Final

from rich.console import Console

from sain_bags.cli.options import ViewOptions
from sain_bags.reading.reader import Bag
from sain_core.cli.command_line import executable

NAME: Final = "recording_page"  # beside a running graph and its page


def run(options: ViewOptions, console: Console) -> None:
    """Become the live page of a bag.

    Raises:
        DatasetError: it is no bag, or not whole.
        ConfigError: the live page is not installed.
    """
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
    words = [word for name, value in given.items() for word in ("-p", f"{name}:={value}")]
    program = str(executable("sain_live", "page_node"))
    return [program, "--ros-args", "-r", f"__node:={NAME}", *words]
