"""`ros2 run sain_eval pusht_learn`: gym-pusht's physics from pushes made there."""

from rich.console import Console

from sain_core.storage import make_folder
from sain_eval.cli.pusht_options import PushtLearnOptions
from sain_eval.pusht.learning import Lesson, learn


def run(options: PushtLearnOptions, console: Console) -> None:
    """Collect, learn, and write the checkpoint."""
    lesson = Lesson(options.random_episodes, options.played_episodes, options.epochs)
    learn(lesson, make_folder(options.out), lambda text: console.print(text, highlight=False))
