"""The pages about parts of one's own: their code is that of the examples, and it suffices."""

import ast
import re

import pytest

from tests.paths import ROOT

PARTS = ROOT / "examples" / "my_parts"
CODE = {
    "model": ROOT / "examples" / "my_model" / "my_model.py",
    **{
        name: PARTS / "my_parts" / f"{name}.py" for name in ("shape", "cost", "planner", "scenario")
    },
}


def block(page: str, language: str) -> str:
    text = (ROOT / "docs" / "guides" / f"your_{page}.md").read_text()
    found = re.search(rf"^```{language}\n(.*?)^```", text, re.M | re.S)
    assert found is not None, f"docs/guides/your_{page}.md has no {language}"
    return found[1]


def without_docstrings(code: str) -> str:
    """Return what code does."""
    tree = ast.parse(code)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(
            node
        ):
            node.body = node.body[1:]
    return ast.dump(tree)


@pytest.mark.parametrize("page", CODE)
def test_a_page_shows_the_code_of_its_example(page):
    assert without_docstrings(block(page, "python")) == without_docstrings(CODE[page].read_text())
    assert page != "model" or len(block(page, "python").strip().splitlines()) <= 30
    toml = block(page, "toml").splitlines()
    project = (CODE[page].parent / "pyproject.toml", PARTS / "pyproject.toml")[page != "model"]
    assert set(filter(None, toml)) - {"# pyproject.toml"} <= set(project.read_text().splitlines())
