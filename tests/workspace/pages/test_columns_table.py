import runpy

from tests.paths import ROOT

TOOL = ROOT / "tools" / "columns.py"


def test_the_table_of_columns_is_current() -> None:
    tool = runpy.run_path(str(TOOL))
    text = tool["PAGE"].read_text(encoding="utf-8")
    assert text.count(tool["BEGIN"]) == text.count(tool["END"]) == 1
    assert text == tool["page"](), "run tools/columns.py"
