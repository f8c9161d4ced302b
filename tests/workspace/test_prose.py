"""The checker of the pages' prose: what it counts as a word and a sentence, and what it refuses."""

import runpy
from pathlib import Path

import pytest

from tests.paths import ROOT

PROSE = runpy.run_path(str(ROOT / "tools" / "prose.py"))
GOOD = "A push names its scene. The simulator executes each id at most once."
LONG = " ".join(["word"] * 26) + "."


def page(folder: Path, text: str) -> Path:
    path = folder / "page.md"
    path.write_text(text)
    return path


def found(folder: Path, text: str) -> list[str]:
    problems = PROSE["problems"](page(folder, text))
    return [str(problem).rpartition("page.md:")[2] for problem in problems]


@pytest.mark.parametrize(
    "text",
    [
        GOOD,
        f"# {LONG}",
        f"| {LONG} |",
        f"![{LONG}](picture.png)",
        f"```\n{LONG}\nhe knows, she wants\n```\n",
        f"Run:\n\n    {LONG}\n",
        "* " + "word " * 25 + "\n* " + "word " * 25,
        "word " * 25 + "\n\n" + "word " * 25,
        "word " * 24 + "word: " + "word " * 25,
        "`a page that knows`",
    ],
)
def test_good_prose_passes(tmp_path: Path, text: str) -> None:
    assert found(tmp_path, text) == []


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (LONG, 1),
        (f"{GOOD} {LONG}", 1),
        (f"# Title\n\n{GOOD}\n{LONG}", 4),
        (f"* {GOOD}\n* {LONG}", 2),
        (f"1. {LONG}", 1),
        (LONG.replace(" ", "\n", 13), 1),
        (LONG.replace(" ", "\n    ", 1), 1),
        (f"```\ncode\n```\n{LONG}", 4),
        ("`code` " * 26, 1),
        ("[a](b.md) " * 9, 1),
    ],
)
def test_a_long_sentence_is_found_with_its_line_and_its_length(
    tmp_path: Path, text: str, line: int
) -> None:
    (problem,) = found(tmp_path, text)
    assert problem.startswith(f"{line}: 2")
    assert "words, 25 at most: " in problem


def test_a_banned_phrase_is_found_in_a_paragraph_and_in_a_table(tmp_path: Path) -> None:
    text = "The network\nknows it.\n\n| a | the disk forgets |\n"
    assert [problem.partition(": say")[0] for problem in found(tmp_path, text)] == [
        '2: "knows"',
        '4: "forgets"',
    ]


def test_a_banned_phrase_is_found_across_a_line_break(tmp_path: Path) -> None:
    assert found(tmp_path, "An error is no\nsurprise.")[0].startswith('1: "no surprise"')


def test_words_are_counted_outside_of_fences() -> None:
    text = "# Two words\n\na `snake_case` 12\n```\nnot these\n```\n| cell |\n\n    indented code\n"
    assert PROSE["words"](text) == 2 + 2 + 1 + 2


def test_words_of_comments_and_of_what_tools_write_are_not_counted() -> None:
    table = "<!-- columns: made by tools/columns.py -->\n\n| cell |\n\n<!-- end of columns -->\n"
    assert PROSE["words"](f"two words\n\n{table}\n<!-- not tested: takes hours -->\none\n") == 3


def test_too_many_words_fail_and_decisions_do_not_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pages = ("README.md", "CONTRIBUTING.md", "bags/README.md", "docker/README.md", "docs/a.md")
    for name in (*pages, "docs/decisions/0001.md"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{GOOD}\n")
    main = PROSE["main"]
    monkeypatch.setitem(main.__globals__, "ROOT", tmp_path)
    assert main([]) == 0
    assert "24 words" in capsys.readouterr().out

    (tmp_path / "docs" / "decisions" / "0001.md").write_text(f"{GOOD}\n\n" * 2000)
    assert main([]) == 0
    (tmp_path / "docs" / "a.md").write_text(f"{GOOD}\n\n" * 2000)
    assert main([]) == 1
    assert "have 24,012 words, 17,000 at most" in capsys.readouterr().out


def test_the_pages_of_this_repository_pass(capsys: pytest.CaptureFixture[str]) -> None:
    assert PROSE["main"]([]) == 0, capsys.readouterr().out
