"""Each message that the page on troubles quotes is one that the code can print."""

import ast
import re

import pytest

from tests.paths import ROOT

PAGE = ROOT / "docs/guides/troubleshooting.md"
MOST_WORDS = 900


def quoted() -> list[str]:
    """The messages in the first column of tables, and those with a gap in the text."""
    text = PAGE.read_text()
    rows = re.findall(r"^\| `([^`]+)` \|", text, re.MULTILINE)
    return [*rows, *re.findall(r"prints `([^`]+)`", text)]


@pytest.fixture(scope="module")
def printable():
    """Every text of the code, one a line, with a gap for each value that it fills in."""
    return "\n".join(
        text_of(node)
        for path in (ROOT / "src").rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.JoinedStr | ast.Constant)
    )


def text_of(node: ast.AST) -> str:
    if isinstance(node, ast.JoinedStr):
        return "".join(map(text_of, node.values))
    return str(node.value) if isinstance(node, ast.Constant) else "…"


@pytest.mark.parametrize("message", quoted())
def test_a_quoted_message_is_in_the_code(message, printable):
    parts = [part.strip() for part in message.split("…")]
    assert any(parts)
    pattern = ".*".join(map(re.escape, parts))
    assert re.search(pattern, printable), f"no code prints {message!r}"


def test_the_page_is_short():
    assert len(quoted()) > 20
    assert len(re.findall(r"[A-Za-z]{2,}", PAGE.read_text())) <= MOST_WORDS
