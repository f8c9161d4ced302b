"""``ros2 run sain_live live``: the whole graph with its live page, until Ctrl-C."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from sain_bringup.graph import OUTLINES_HELP, PAGE, GraphOptions, stated_bodies
from sain_bringup.running import run as run_graph
from sain_core.cli.command_line import command_of_node
from sain_core.config import option
from sain_eval.scenes.scenarios import SCENARIOS, check_in_graph, check_scenario
from sain_live.settings import PageConfig, check_free
from sain_sim.world.truth import TRUTHS, TruthConfig


@dataclass(frozen=True)
class LiveOptions(GraphOptions):
    """Start the whole graph and a page in the browser that shows and steers it.

    The page has the scene, goals to drag, the planner's settings, charts and a log. It prints its
    address. Only browsers on this computer can open it, unless --host says otherwise. What dies
    or hangs is restarted. Ctrl-C ends all of it.
    """

    scenario: str = option(
        "push_t", f"scene to begin with: {', '.join(SCENARIOS)}, or of an installed package"
    )
    outlines: Path | None = option(None, OUTLINES_HELP)
    world: str = option("randomised", "hidden truth about friction and contacts", choices=TRUTHS)
    host: str = option("127.0.0.1", "address to listen at; 0.0.0.0: open to other computers")
    port: int = option(8080, "port to listen at", minimum=1, maximum=65535)
    real_time_factor: float = option(
        1.0, "simulated time over wall time; 0: as fast as possible", minimum=0.0, maximum=100.0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        TruthConfig(self.world, engine=self.engine, bottom=self.bottom)
        if not self.is_real:
            check_in_graph(self.scenario, self.engine)
        PageConfig(self.host, self.port)

    def simulator(self) -> dict[str, str]:
        """Have the arm move all the way, as fast as is asked for."""
        pace = {"cell.full_motion": "true", "real_time_factor": str(self.real_time_factor)}
        return {**pace, "world": self.world, **stated_bodies(self.scenario, self.outlines)}

    def own_commands(self, ros: Sequence[str]) -> dict[str, list[str]]:
        """Return the command of the page, beside a robot's."""
        page = {name: getattr(self, name) for name in ("host", "port", "seed", "scenario")}
        page |= {"scenario": "''"} if self.is_real else {}  # nothing there is reset
        page |= {"outlines": self.outlines.absolute()} if self.outlines else {}
        commands = super().own_commands(ros)
        return commands | {PAGE: command_of_node("sain_live", "page_node", ros, **page)}


def run(options: LiveOptions, console: Console) -> int:
    """Run graph and page until they are interrupted; return the exit code.

    Raises:
        BusyError: the port is in use; nothing was started.
        SainError: a package is not installed, a log cannot be written, or a file has no such body.
    """
    if not options.is_real:
        check_scenario(options.scenario, options.outlines)
    check_free(options.host, options.port)
    return run_graph(options, console)
