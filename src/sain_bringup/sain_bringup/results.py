"""What a run leaves behind: summary, pictures and a page, all made from the bag."""

from contextlib import ExitStack, closing
from pathlib import Path

from sain_bags.reading.reader import Bag
from sain_bags.report.content import read_content
from sain_bags.report.writing import write_page
from sain_bringup.display import Display
from sain_bringup.movie import (
    Film,
    MovieConfig,
    Scenery,
    choose_moments,
    encode_gif,
    episode_moments,
)
from sain_bringup.report import PlayedEpisode, played_episodes, summary_table, write_summary
from sain_core.scene import RADIUS
from sain_core.storage import write_whole
from sain_core.types import Points
from sain_sim.world.engines import BULLET, is_installed, needs

LIVELY = 8  # pushes: the moving picture shows the longest episode with no more than these


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
    with ExitStack() as rendering:
        film = None
        if video and played and not is_installed(BULLET):
            display.console.print(f"  no moving picture: it {needs(BULLET)}", soft_wrap=True)
        elif video and played:
            film = rendering.enter_context(closing(begin_film(bag, choose_episode(played))))
        with display.stage("drawing the episodes", "episodes drawn"):
            draw_pictures(folder, played)
            write_page(folder / "report.html", read_content(bag).data)
        if film is not None:
            with display.stage("rendering the moving picture", "moving picture rendered"):
                gif = encode_gif(film.frames(), MovieConfig())
                write_whole(folder / "closed_loop.gif", gif)
    display.console.print()
    display.console.print(summary_table(summaries), soft_wrap=True)
    display.console.print("\nWritten, to be opened in this order:")
    for path in written_files(folder):
        display.console.print(f"  {path}", markup=False, highlight=False, soft_wrap=True)
    return bool(summaries) and all(summary["success"] for summary in summaries)


def written_files(folder: Path) -> list[Path]:
    """Return what a run has written, the report page first, the bag and the logs last."""
    files = [path for path in sorted(folder.iterdir()) if path.is_file()]
    files.sort(key=lambda path: (path.suffix != ".html", path.suffix != ".gif"))
    return [*files, *(path for path in sorted(folder.iterdir()) if path.is_dir())]


def draw_pictures(folder: Path, played: tuple[PlayedEpisode, ...]) -> list[Path]:
    """Draw a top view of each episode towards its last goal, and one picture of all."""
    from sain_core.drawing.figures import write_png  # matplotlib takes a while to load
    from sain_eval.plots.pictures import draw_episode, draw_overview

    records = [episode.last_part().record() for episode in played]
    paths = [
        write_png(draw_episode(record), folder / f"episode_{number}.png")
        for number, record in enumerate(records, start=1)
    ]
    if records:
        paths.append(write_png(draw_overview(records), folder / "overview.png"))
    return paths


def choose_episode(played: tuple[PlayedEpisode, ...]) -> PlayedEpisode:
    """Return the episode that is nicest to watch: a success, long but not too long."""

    def charm(one: PlayedEpisode) -> tuple[bool, int]:
        pushes = len(one.episode.executed)
        return one.episode.success, pushes if pushes <= LIVELY else -pushes

    return max(played, key=charm)


def begin_film(bag: Bag, one: PlayedEpisode, config: MovieConfig = MovieConfig()) -> Film:
    """Begin to render one episode from its recording."""
    one = one.last_part()
    assert one.episode.goal is not None
    place, pose = one.episode.goal.places[0], one.episode.goal.poses[0]
    # The body has reached its place when it lies wholly inside the ring.
    ring = float(one.episode.start[pose.body, RADIUS]) + pose.tolerance
    shapes = tuple(shape.name for shape in one.record().bodies.shapes)
    scenery = Scenery(one.episode.start, shapes, _goal_outline(one), place, ring, one.title, config)
    return Film(scenery, choose_moments(episode_moments(bag, one.episode), config))


def _goal_outline(one: PlayedEpisode) -> Points | None:
    """Return the first body's outline (C, 2) [m] in its goal; None: no heading is asked for."""
    record, body = one.record(), one.episode.aimed
    if record.goal.poses[0].heading is None:
        return None
    return record.bodies.shapes[body].placed(record.goal.placed(record.start)[body])
