"""`ros2 run sain_eval results`: one page from several evaluations."""

from rich.console import Console

from sain_core.storage import make_folder, write_whole
from sain_eval.cli.options import ResultsOptions
from sain_eval.loop.results_page import read_results, results_page


def run(options: ResultsOptions, console: Console) -> None:
    """Write the page, and print its path.

    Raises:
        DatasetError: a folder holds no results.
        OutputError: the page cannot be written.
    """
    page = results_page([read_results(folder) for folder in options.folders], options.name_of)
    make_folder(options.out.parent)
    write_whole(options.out, page.encode())
    console.print(str(options.out), markup=False, highlight=False, soft_wrap=True)
