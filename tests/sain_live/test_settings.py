"""Where the page may listen."""

import socket
from contextlib import closing

import pytest

from sain_core.errors import BusyError
from sain_live.settings import PageConfig, check_free, is_loopback


def test_a_port_in_use_is_named_and_what_to_do():
    with closing(socket.socket()) as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(BusyError, match=rf"port {port} .* in use .*; stop it, or choose"):
            check_free("127.0.0.1", port)
    check_free("127.0.0.1", port)


def test_it_listens_on_this_computer_alone_by_default():
    assert is_loopback(PageConfig().host)
    assert not is_loopback("0.0.0.0")
    assert PageConfig(host="0.0.0.0", port=81).address == "http://127.0.0.1:81"
