"""Checks the prose of the Markdown pages: short sentences, few words, plain terms.

./env python tools/prose.py [PAGE...]

* A word of the total is two or more letters of a-z outside of fenced code, comments and the names
  of tests. One total is over README.md and docs/, without what tools write: pages, and parts from
  ``<!-- columns: made by tools/... -->`` to ``<!-- end of columns -->``. The other is over
  docs/decisions/ and docs/notebook/.
* A sentence is a part of a paragraph or list item. It ends with ``.``, ``!``, ``?`` or ``:`` before
  a space, with a blank line, or with the next list item. Fenced and indented code, tables,
  headings, images and HTML are no sentences.
* A word of a sentence is a run of letters, digits, hyphens and apostrophes in the Markdown source,
  so that code and the targets of links count too.

Exits with 1 when a sentence is too long, the total is too large, or a banned phrase occurs.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
MOST_WORDS = 13_000
MOST_WORDS_OF_RECORDS = 5_300
LONGEST_SENTENCE = 25
RECORDS = ("decisions", "notebook")  # folders: why things are as they are, and what was tried
# Pages that tools write.
GENERATED = {"anything.md", "faults.md", "parameters.md", "pusht.md", "real.md", "results.md"}

BANNED = re.compile(
    # Idioms that a reader of a second language stumbles over, and what a machine does not do.
    r"\b(?:it\s+pays|network\s+pays|forgets?|knows?|wants?|speaks?\s+for|over\s+ours|in\s+one\s+go|by\s+a\s+hair)\b"
    r"|\b(?:is|are|was|were|be|been)\s+told\b|\btold\s+(?:the|nothing|of)\b"
    r"|\bno\s+surprise\b|\ba\s+Tuesday\b|\bthe\s+word\s+that\b|\bwhat\s+became\s+of\b"
    r"|\bread\s+it\s+as\s+it\s+stands\b",
    re.IGNORECASE,
)
ADDRESS = re.compile(r"(?<=\])\([^)]*\)")
CODE = re.compile(r"`[^`]*`")
COMMENT = re.compile(r"<!-- (\w+): made by .*?<!-- end of \1 -->|<!--.*?-->", re.DOTALL)
FENCE = re.compile(r"\s*(```|~~~)")
NO_SENTENCE = ("|", "#", "![", "<")
SENTENCE_END = re.compile(r"(?<=[.!?:])\s+")
TEST = re.compile(r"`tests/\S+::\w+`")
WORD = re.compile(r"[A-Za-z]{2,}")
WORD_OF_A_SENTENCE = re.compile(r"[A-Za-z0-9'-]+")


@dataclass(frozen=True)
class Line:
    """A line of a page outside of fenced code, with its number from 1."""

    number: int
    text: str


@dataclass(frozen=True)
class Problem:
    """What is wrong, and where."""

    page: Path
    line: int
    text: str

    def __str__(self) -> str:
        page = self.page.relative_to(ROOT) if self.page.is_relative_to(ROOT) else self.page
        return f"{page}:{self.line}: {self.text}"


def lines_outside_fences(text: str) -> Iterator[Line]:
    """Yield the lines of a page; each fenced block becomes one empty line."""
    fence = None
    for number, line in enumerate(text.splitlines(), start=1):
        mark = FENCE.match(line)
        if fence is None and mark:
            fence = mark[1]
            yield Line(number, "")
        elif fence is None:
            yield Line(number, line)
        elif mark and mark[1] == fence:
            fence = None


def blocks(text: str) -> Iterator[list[Line]]:
    """Yield the paragraphs and list items of a page."""
    block: list[Line] = []
    for line in lines_outside_fences(text):
        if line.text.startswith(NO_SENTENCE) or (not block and line.text.startswith("    ")):
            continue
        if not line.text.strip() or line.text.startswith(("* ", "- ")):
            yield block
            block = []
        if line.text.strip():
            block.append(line)
    yield block


def sentences(text: str) -> Iterator[Line]:
    """Yield the sentences of a page, each with the line on which it begins."""
    for block in blocks(text):
        joined = "\n".join(line.text for line in block)
        start = 0
        for end in [*(match.end() for match in SENTENCE_END.finditer(joined)), len(joined)]:
            if joined[start:end].strip():
                number = block[joined.count("\n", 0, start)].number
                yield Line(number, " ".join(joined[start:end].split()))
            start = end


def banned_phrases(text: str) -> Iterator[Line]:
    """Yield the banned phrases of a page outside of code and addresses, each with its line."""
    lines = list(lines_outside_fences(text))
    prose = "\n".join(line.text for line in lines)
    for hidden in (CODE, ADDRESS):
        prose = hidden.sub(lambda match: "\n" * match[0].count("\n"), prose)
    for phrase in BANNED.finditer(prose):
        number = lines[prose.count("\n", 0, phrase.start())].number
        yield Line(number, " ".join(phrase[0].split()))


def words(text: str) -> int:
    """Return the number of words of a page but for fenced code, tests and what tools write."""
    written = TEST.sub("", COMMENT.sub("", text))
    return sum(len(WORD.findall(line.text)) for line in lines_outside_fences(written))


def problems(page: Path) -> Iterator[Problem]:
    """Yield the sentences of a page that are too long, and its banned phrases."""
    text = page.read_text(encoding="utf-8")
    for sentence in sentences(text):
        count = len(WORD_OF_A_SENTENCE.findall(sentence.text))
        if count > LONGEST_SENTENCE:
            long = f"{count} words, {LONGEST_SENTENCE} at most: {sentence.text}"
            yield Problem(page, sentence.number, long)
    for phrase in banned_phrases(text):
        said = f'"{phrase.text}": say it plainly, see CONTRIBUTING.md'
        yield Problem(page, phrase.number, said)


def counted_pages(root: Path) -> list[Path]:
    """Return the pages whose words are counted."""
    return [page for page in guide_pages(root) if page.name not in GENERATED]


def guide_pages(root: Path) -> list[Path]:
    """Return README.md and the pages of docs/, without decisions and notebook."""
    docs = (root / "docs").rglob("*.md")
    return [root / "README.md", *sorted(path for path in docs if not {*RECORDS} & {*path.parts})]


def record_pages(root: Path) -> list[Path]:
    """Return the decisions and the notebook."""
    return sorted(path for name in RECORDS for path in (root / "docs" / name).glob("*.md"))


def checked_pages(root: Path) -> list[Path]:
    """Return the pages whose sentences are checked."""
    others = [root / name for name in ("CONTRIBUTING.md", "bags/README.md", "docker/README.md")]
    return [
        *guide_pages(root),
        *record_pages(root),
        *others,
        *sorted((root / "examples").rglob("*.md")),
    ]


def total_words(pages: list[Path]) -> int:
    """Return the number of words of several pages."""
    return sum(words(page.read_text(encoding="utf-8")) for page in pages)


def main(arguments: list[str]) -> int:
    """Check the pages named, or all of them and their words; return the exit status."""
    named = [Path(argument).resolve() for argument in arguments]
    found = [problem for page in named or checked_pages(ROOT) for problem in problems(page)]
    for problem in found:
        print(problem)
    total = total_words(named or counted_pages(ROOT))
    records = total_words(record_pages(ROOT))
    too_many = not named and (total > MOST_WORDS or records > MOST_WORDS_OF_RECORDS)
    if too_many:
        print(f"README.md and docs/ have {total:,} words, {MOST_WORDS:,} at most")
        print(f"decisions and notebook have {records:,}, {MOST_WORDS_OF_RECORDS:,} at most")
    if not found and not too_many:
        print(f"prose: {total:,} words, every sentence at most {LONGEST_SENTENCE}")
    return 1 if found or too_many else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
