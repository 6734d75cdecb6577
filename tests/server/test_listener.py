"""The public port: taken, free, foreign."""

from __future__ import annotations

import socket

import pytest

from server.supervision.listener import PortUnavailable, address_of, is_loopback, listen


def test_port_0_takes_a_free_one() -> None:
    with listen("127.0.0.1", 0) as listener:
        port = listener.getsockname()[1]
        assert port > 0
        assert address_of("127.0.0.1", listener) == f"http://127.0.0.1:{port}/"
        assert is_loopback(listener)
        with socket.create_connection(("127.0.0.1", port), timeout=5.0):
            pass


def test_a_taken_port_is_refused() -> None:
    with listen("127.0.0.1", 0) as listener:
        port = listener.getsockname()[1]
        with pytest.raises(PortUnavailable, match=f"port {port} on 127.0.0.1 is taken") as caught:
            listen("127.0.0.1", port)
        assert (caught.value.host, caught.value.port) == ("127.0.0.1", port)


def test_a_port_can_be_taken_again_at_once() -> None:
    with listen("127.0.0.1", 0) as listener:
        port = listener.getsockname()[1]
        with socket.create_connection(("127.0.0.1", port), timeout=5.0):
            listener.accept()[0].close()
    listen("127.0.0.1", port).close()


def test_foreign_addresses_are_refused() -> None:
    with pytest.raises(PortUnavailable, match=r"192\.0\.2\.1 is not an address of this machine"):
        listen("192.0.2.1", 0)
    with pytest.raises(PortUnavailable, match="not known"):
        listen("no such host", 0)
    with pytest.raises(PortUnavailable, match="not known"):
        listen("a" * 70, 0)


def test_every_interface_is_opened_by_its_loopback_address() -> None:
    with listen("0.0.0.0", 0) as listener:
        assert address_of("0.0.0.0", listener).startswith("http://127.0.0.1:")
        assert not is_loopback(listener)


def test_ipv6_addresses_are_bracketed() -> None:
    with listen("127.0.0.1", 0) as listener:
        assert address_of("::1", listener).startswith("http://[::1]:")
        assert address_of("::", listener).startswith("http://[::1]:")
