"""What a page is made of."""

from pathlib import Path

from sain_bags.reading.reader import Bag
from sain_bags.report.content import read_content
from sain_bags.report.gathering import Limits


def content(folder: Path, **limits: int) -> dict:
    return read_content(Bag(folder), Limits(**limits)).data
