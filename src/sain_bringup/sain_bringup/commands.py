"""The executables of this package, with the modules of it that they load."""

from typing import Final

from sain_core.cli.command_line import Command

closed_loop: Final = Command(
    "sain_bringup closed_loop", "options:ClosedLoopOptions", "ros.closed_loop:run", ros=True
)
graph: Final = Command("sain_bringup graph", "graph_options:GraphOptions", "running:run", ros=True)
live: Final = Command("sain_bringup live", "graph_options:LiveOptions", "live:run", ros=True)
goal: Final = Command("sain_bringup goal", "options:GoalOptions", "ros.goal:run", ros=True)
push: Final = Command("sain_bringup push", "options:PushOptions", "ros.push:run", ros=True)
reset: Final = Command("sain_bringup reset", "options:ResetOptions", "ros.reset:run", ros=True)
watch: Final = Command("sain_bringup watch", "options:WatchOptions", "ros.watch:run", ros=True)
