from itertools import islice

from sain_core.push import push_ids


def test_two_senders_share_no_id_and_none_is_zero() -> None:
    first, second = (set(islice(push_ids(), 1000)) for _ in range(2))
    assert not first & second
    assert len(first) == 1000
    assert min(first | second) > 0
    assert max(first | second) < 2**53
