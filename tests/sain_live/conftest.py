"""Recordings made by hand, as in the tests of bags."""

from tests.sain_bags.conftest import episode_bag, messages, record

__all__ = ["episode_bag", "messages", "record"]
