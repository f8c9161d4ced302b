"""The executables of this package."""

from typing import Final

from sain_core.cli.command_line import Command

closed_loop: Final = Command(
    "sain_bringup closed_loop",
    options="sain_bringup.options:ClosedLoopOptions",
    work="sain_bringup.ros.closed_loop:run",
    ros=True,
)
push: Final = Command(
    "sain_bringup push",
    options="sain_bringup.options:PushOptions",
    work="sain_bringup.ros.push:run",
    ros=True,
)
watch: Final = Command(
    "sain_bringup watch",
    options="sain_bringup.options:WatchOptions",
    work="sain_bringup.ros.watch:run",
    ros=True,
)
