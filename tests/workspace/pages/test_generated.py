"""Pages that a tool writes are those that it would write now."""

import runpy

import pytest

from tests.paths import ROOT


@pytest.mark.parametrize("name", ["columns", "packages", "parameters"])
def test_it_is_current(name):
    tool = runpy.run_path(str(ROOT / "tools" / f"{name}.py"))
    assert tool["PAGE"].read_text(encoding="utf-8") == tool["page"](), f"run tools/{name}.py"
