"""What docs/guides/real_pushes.md shows is run as it stands there; training is short."""

import re
from importlib import import_module
from pathlib import Path

from sain_model.data.dataset import load_dataset
from tests.definitions import find_own
from tests.documentation.shell import ROOT, command_blocks, commands_in

PAGE = ROOT / "docs/guides/real_pushes.md"
SHORT = {"train": ["--epochs", "1", "--epoch-steps", "2"]}


def test_the_page_s_commands_run(tmp_path, monkeypatch, capsys):
    text, scratch = PAGE.read_text(encoding="utf-8"), tmp_path / "shell"
    scratch.mkdir()
    monkeypatch.chdir(tmp_path)
    for name, block in (
        ("pushes.csv", r"```\n(object,.*?)```"),
        ("outlines.yaml", r"```yaml\n(.*?)```"),
    ):
        found = re.search(block, text, re.DOTALL)
        assert found, name
        Path(name).write_text(found[1])
    assert len(Path("pushes.csv").read_text().splitlines()) == 10
    blocks = [block for block in command_blocks(PAGE) if not block.reason]
    run = [words for block in blocks for words in commands_in(block.code, scratch)]
    names = ["real_import", "identify", "train", "from_dataset", "report"]
    assert [words[4] for words in run] == names
    find_own(tmp_path, monkeypatch)
    for words in run:
        command = getattr(import_module(f"{words[3]}.commands"), words[4])
        assert command([*words[5:], *SHORT.get(words[4], [])]) == 0, capsys.readouterr()
    printed = capsys.readouterr().out
    assert "9 pushes of 1 bodies; surfaces: steel 9" in printed
    assert re.search(r"regions are fitted to \d held-out pushes; with fewer than 60", printed)
    data = load_dataset(Path("data/lab")).alike
    assert data.action.shape == (9, 11)
    assert Path("runs/lab/sain.safetensors").exists()
    assert "9 pushes" in printed.split("written to")[-1] and Path("bags/lab.html").exists()
