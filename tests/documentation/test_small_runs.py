"""Commands of the pages that need no graph are run, on a few rows, scenes and epochs."""

import shutil
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from sain_bags.writing.writer import BagWriter
from sain_core.cli.command_line import Command
from sain_eval.plots import library_picture
from tests.documentation.coverage import PAGES_BY_TEST, SMALL, program
from tests.documentation.shell import PAGES, command_blocks, commands_in, page_name
from tests.sain_bags.conftest import Messages, Recording
from tests.sain_bags.driven import Drive
from tests.sain_model.rolling import EPISODES, EVERY, PUSHES, make_episodes

LESS = {  # options whose value is smaller here than on the pages
    "--episodes": "1", "--floor-episodes": "1", "--workers": "1", "--scenes": "1", "--epochs": "1",
    "--rollout-epochs": "1", "--steps-ahead": "2", "--steps": "20", "--epoch-steps": "20",
    "--pictures": "1",
    "--transitions": "40",
}  # fmt: skip
ALWAYS = {  # options that keep a command short and are not on every page
    "sain_sim collect": ("--episodes",),
    "sain_model train": ("--epochs", "--epoch-steps", "--rollout-epochs"),
    "sain_eval evaluate": ("--scenes",),
}


def small(name: str, words: list[str]) -> list[str]:
    """The arguments of a command for a small run."""
    kept = [word for word in words if word != "..."]
    for option in ALWAYS.get(name, ()):
        if option not in kept:
            kept += [option, LESS[option]]
    if "--out" not in kept and name in ("sain_sim collect", "sain_model train"):
        kept += ["--out", "made"]
    shrunk = [LESS.get(option, word) for option, word in zip(["", *kept], kept, strict=False)]
    return shrunk if name != "sain_model train" or "..." not in words else ["DATASET", *shrunk]


def prepare(arguments: list[str], folder: Path) -> None:
    """Put recordings and rows where a command reads them, and clear the place that it writes to."""
    sources = []
    shutil.rmtree(folder / "results", ignore_errors=True)
    for before, word in zip(["", *arguments], arguments, strict=False):
        path = folder / word
        if before == "--out":
            shutil.rmtree(path, ignore_errors=True)
        elif word == "DATASET" or word.startswith("data/"):
            sources.append(path)
        elif word.startswith("bags/") and not path.exists():
            shutil.copytree(folder / "bag", path)
    shares = np.array_split(np.arange(EPISODES), max(len(sources), 1))
    for path, episodes in zip(sources, shares, strict=False):
        shutil.rmtree(path, ignore_errors=True)
        make_episodes(path, EVERY[np.isin(EVERY // PUSHES, episodes)])


def commands_of(page: Path, folder: Path) -> list[list[str]]:
    """The commands of a page that are run here, in its order."""
    return [
        words
        for block in command_blocks(page)
        if not block.reason
        for words in commands_in(block.code, folder)
        if program(words) in SMALL and "--help" not in words
    ]


def run(words: list[str], folder: Path) -> int:
    """Run one of them in a folder, which is the current one."""
    name = program(words)
    if name == "sain_eval.plots.library_picture":
        return library_picture.main(["shapes.png"])
    package, executable = name.split()
    arguments = small(name, words[words.index(executable) + 1 :])
    prepare(arguments, folder)
    command = getattr(import_module(f"{package}.commands"), executable)
    assert isinstance(command, Command)
    return command(arguments)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording from which commands begin."""
    folder = tmp_path_factory.mktemp("made") / "bag"
    recording = Recording(BagWriter(folder), Messages())
    drive = Drive(recording)
    for episode in range(1, 6):
        drive.episode(episode, [10 * episode + place for place in range(3)])
    recording.writer.close()
    return folder


@pytest.mark.parametrize(
    "page", [page for page in PAGES if page_name(page) not in PAGES_BY_TEST], ids=page_name
)
def test_commands_of_a_page_run(
    page: Path, recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    scratch = tmp_path / "shell"
    scratch.mkdir()
    (tmp_path / "bag").symlink_to(recorded)
    monkeypatch.chdir(tmp_path)
    for words in commands_of(page, scratch):
        assert run(words, tmp_path) == 0, f"{words}: {capsys.readouterr()}"
