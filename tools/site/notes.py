"""Marks on code blocks whose commands no test runs.

    <!-- not tested: takes an hour -->
    ```
    ./env python -m benchmarks.gates
    ```

In the repository a mark is not shown. In the site it is a small note below the block.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass

BLOCK = re.compile(
    r"(?:^<!-- not tested: (?P<reason>[^\n]+?) -->\n+)?"
    r"^(?P<indent> *)(?P<fence>```|~~~)(?P<language>\w*)[^\n]*\n"
    r"(?P<code>.*?)^(?P=indent)(?P=fence) *$",
    re.DOTALL | re.MULTILINE,
)
STARTS = ("make ", "./env ", "ros2 ", "python ", "pip ", "docker ", "nice ", "for ", "train ",
          "examples/")  # fmt: skip
INDENTED = re.compile(
    r"(?:^<!-- not tested: (?P<reason>[^\n]+?) -->\n)?^\n(?P<code>(?:    [^\n]*\n|\n)+)",
    re.MULTILINE,
)


@dataclass(frozen=True)
class CodeBlock:
    """A block of code on a page.

    Attributes:
        code: its text.
        language: that is named after its fence; "": none.
        reason: why no test runs it; "": one does, or it holds no commands.
        line: of the page on which it begins, from 1.
    """

    code: str
    language: str
    reason: str
    line: int


def code_blocks(text: str) -> Iterator[CodeBlock]:
    """Yield the blocks of code of a page: fenced ones, then indented ones."""
    for found in BLOCK.finditer(text):
        line = text.count("\n", 0, found.start("fence")) + 1
        yield CodeBlock(found["code"], found["language"], found["reason"] or "", line)
    bare = BLOCK.sub(lambda match: "\n" * match[0].count("\n"), text)
    for found in INDENTED.finditer(bare):
        if code := re.sub(r"^    ", "", found["code"], flags=re.MULTILINE).strip("\n"):
            line = bare.count("\n", 0, found.start("code")) + 1
            yield CodeBlock(code + "\n", "", found["reason"] or "", line)


def holds_commands(code: str) -> bool:
    """Tell whether the first line of a block that is no comment starts a program."""
    lines = [line for line in code.splitlines() if line.strip() and not line.startswith("#")]
    return bool(lines) and lines[0].startswith(STARTS)


def with_notes(text: str) -> str:
    """Return a page that shows below each marked block why it is not tested."""

    def change(match: re.Match[str]) -> str:
        if not match["reason"]:
            return match[0]
        block = match[0].partition("-->")[2].lstrip("\n")
        return f'{block}\n\n<p class="not-tested">Not tested: {match["reason"]}.</p>'

    return BLOCK.sub(change, text)
