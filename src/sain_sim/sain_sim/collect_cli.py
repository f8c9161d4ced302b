"""``ros2 run sain_sim collect``: a training set from the randomised or the rough world."""

import sys
import time

import tyro
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from sain_core.errors import SainError
from sain_sim.collect import CollectConfig, collect


def main(arguments: list[str] | None = None) -> int:
    """Collect transitions into a folder of shards; run it again to go on after a stop."""
    console = Console(stderr=True)
    config = tyro.cli(
        CollectConfig,
        prog="collect",
        description=main.__doc__,
        args=arguments,
        config=(tyro.conf.OmitArgPrefixes,),
    )
    begun = time.perf_counter()
    try:
        total = _collect_with_bar(config, console)
    except SainError as error:
        console.print(f"[red]error:[/] {error}", highlight=False, soft_wrap=True)
        return 1
    except KeyboardInterrupt:
        console.print("stopped; the same command goes on from the last whole shard")
        return 130
    minutes = (time.perf_counter() - begun) / 60
    console.print(f"{total} transitions in {config.out} ({minutes:.1f} min)")
    return 0


def _collect_with_bar(config: CollectConfig, console: Console) -> int:
    columns = (
        TextColumn("collect"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("episodes, {task.fields[transitions]} transitions, left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console) as bar:
        task = bar.add_task("collect", total=config.episodes, transitions=0)

        def advance(episodes: int, transitions: int) -> None:
            bar.update(task, completed=episodes, transitions=transitions)

        return collect(config, advance)


if __name__ == "__main__":
    sys.exit(main())
