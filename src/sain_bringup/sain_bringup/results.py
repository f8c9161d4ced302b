"""What a run leaves behind: summary, top views and the moving picture, all made from the bag."""

from pathlib import Path

from sain_bags.reader import Bag
from sain_bringup.display import Display
from sain_bringup.report import played_episodes, summary_table, write_summary


def write_results(folder: Path, video: bool, display: Display) -> bool:
    """Write everything that is made from the recording in ``folder/bag``.

    Returns:
        Whether every episode reached its goal.
    """
    with display.stage("reading the recording", "recording checked"):
        bag = Bag(folder / "bag")
        bag.check()
        played = played_episodes(bag)
        summaries = tuple(episode.summary() for episode in played)
        write_summary(folder / "summary.json", bag, summaries)
    display.console.print()
    display.console.print(summary_table(summaries))
    display.console.print(f"\n{folder}", highlight=False)
    return bool(summaries) and all(summary.success for summary in summaries)
