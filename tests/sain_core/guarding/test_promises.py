"""Each promise of docs/reference/guarding.md names a test that there is."""

import ast
import re

import pytest

from tests.paths import ROOT

PAGE = (ROOT / "docs/reference/guarding.md").read_text()
ROWS = re.findall(r"^\| (.+) \| `(\S+)::(\w+)` \|$", PAGE, re.MULTILINE)


@pytest.mark.parametrize(("promise", "path", "test"), ROWS)
def test_a_promise_has_its_test(promise, path, test):
    tree = ast.parse((ROOT / path).read_text())
    assert test in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}, promise


def test_every_row_is_read():
    assert len(ROWS) == PAGE.count("::") > 20
