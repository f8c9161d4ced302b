"""How a page is written: nothing in it is from elsewhere, and no text of a bag becomes markup."""

import json
from html.parser import HTMLParser

from hypothesis import given, settings
from hypothesis import strategies as st

from sain_bags.report.writing import render_page
from tests.sain_bags.report.contents import content


class Parts(HTMLParser):
    """The tags of a page, and what stands in its scripts."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.scripts: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        if tag == "script":
            self.scripts.append("")

    def handle_data(self, data):
        if self.tags and self.tags[-1] == "script" and self.cdata_elem == "script":
            self.scripts[-1] += data


@settings(max_examples=25)  # each page is long
@given(st.text(), st.sampled_from(["</script>", "<!--<script>", "]]>", "\u2028", "@@data@@"]))
def test_no_text_gets_out_of_its_script(text, end):
    data = {"bag": {"name": text + end}, "custom": [[end + text, end]]}
    parts = Parts(render_page(data))
    assert parts.tags.count("script") == 2 and "img" not in parts.tags
    assert json.loads(parts.scripts[0]) == data


def test_nothing_in_the_page_is_from_elsewhere(bag):
    page = render_page(content(bag)).replace("http://www.w3.org/2000/svg", "")
    assert "http:" not in page and "https:" not in page
    assert "import(" not in page and "fetch(" not in page and "innerHTML" not in page
