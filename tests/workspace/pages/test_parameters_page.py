import runpy

from tests.paths import ROOT

TOOL = ROOT / "tools" / "parameters.py"


def test_the_page_about_parameters_is_current() -> None:
    tool = runpy.run_path(str(TOOL))
    assert tool["PAGE"].read_text(encoding="utf-8") == tool["page"](), "run tools/parameters.py"
