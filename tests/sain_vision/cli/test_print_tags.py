"""Sheets of tags by the command's options: what they allow, and what the sheets have on them."""

import pytest
from rich.console import Console

from sain_core.errors import ConfigError
from sain_vision.cli.print_tags import PrintOptions, run


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"tags": "0-1000000000"}, "'0-1000000000'; the family has the tags 0 to 586"),
        ({"tags": "30", "family": "16h5"}, "'30'; the family has the tags 0 to 29"),
        ({"tags": "-3"}, "'-3'; allowed: numbers and upward ranges, as in 1,4,7-8"),
        ({"tags": "1,,2"}, "'1,,2'; allowed: numbers and upward ranges"),
        ({"tags": "1-4,3"}, "'1-4,3', which has tag 3 twice; give each once"),
        ({"tags": "0-200"}, "'0-200', 201 tags; allowed: 1 to 200"),
        ({"size": 0.2}, "size is 0.2 m; on a4 at most 0.147 m has room"),
        ({"board": True, "tags": "5"}, "--board has its own tags; leave out --tags"),
    ],
)
def test_what_is_not_printed_is_refused_in_a_line(options, text, tmp_path):
    with pytest.raises(ConfigError) as caught:
        run(PrintOptions(out=tmp_path / "tags.pdf", **options), Console())
    assert text in str(caught.value) and "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_each_tag_has_its_number_size_and_x_axis(tmp_path):
    path = tmp_path / "tags.pdf"
    run(PrintOptions(out=path, tags="4,7-8", size=0.147), Console())
    sheets = path.read_bytes()
    assert all(f"(36h11 {number}: 147 mm, x ->)".encode() in sheets for number in (4, 7, 8))
    assert sheets.count(b"/Type /Page ") == 3
