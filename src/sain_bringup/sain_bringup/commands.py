"""The executables of this package, with the modules of it that they load."""

from typing import Final

from sain_core.cli.command_line import Command

closed_loop: Final = Command("sain_bringup closed_loop", "ros.closed_loop", ros=True)
graph: Final = Command("sain_bringup graph", "running", ros=True)
goal: Final = Command("sain_bringup goal", "ros.goal", ros=True)
push: Final = Command("sain_bringup push", "ros.push", ros=True)
reset: Final = Command("sain_bringup reset", "ros.reset", ros=True)
watch: Final = Command("sain_bringup watch", "ros.watch", ros=True)
