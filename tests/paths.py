"""Where things are in the checkout, however deep the test is that asks."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
