"""What a run leaves behind: summary, top views and the moving picture, all made from the bag."""

from pathlib import Path

from sain_bags.reader import Bag
from sain_bringup.display import Display
from sain_bringup.report import PlayedEpisode, played_episodes, summary_table, write_summary


def write_results(folder: Path, video: bool, display: Display) -> bool:
    """Write everything that is made from the recording in ``folder/bag``.

    Returns:
        Whether every episode reached its goal.

    Raises:
        DatasetError: the recording is damaged.
        OutputError: something cannot be written.
    """
    with display.stage("reading the recording", "recording checked"):
        bag = Bag(folder / "bag")
        bag.check()
        played = played_episodes(bag)
        summaries = tuple(episode.summary() for episode in played)
        write_summary(folder / "summary.json", bag, summaries)
    with display.stage("drawing the episodes", "episodes drawn"):
        draw_pictures(folder, played)
    display.console.print()
    display.console.print(summary_table(summaries))
    display.console.print(f"\n{folder}", highlight=False)
    return bool(summaries) and all(summary.success for summary in summaries)


def draw_pictures(folder: Path, played: tuple[PlayedEpisode, ...]) -> list[Path]:
    """Draw a top view of each episode, and one picture of all."""
    from sain_bringup.overview import draw_overview
    from sain_eval.pictures import draw_episode, save_picture  # matplotlib takes a while to load

    records = [episode.record() for episode in played]
    paths = [
        save_picture(draw_episode(record), folder / f"episode_{number}.png")
        for number, record in enumerate(records, start=1)
    ]
    if records:
        paths.append(save_picture(draw_overview(records), folder / "overview.png"))
    return paths
