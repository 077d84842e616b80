"""Who may use the studio: this machine and its own page, others only with the token."""

from __future__ import annotations

from urllib.parse import urlsplit

import pytest

from choreograph.studio.refusals import ForbiddenError
from choreograph.studio.safety import Access, is_loopback

LOCAL, OPEN = Access(8000), Access(8000, "0.0.0.0", "secret")


@pytest.mark.parametrize(
    "host",
    ["127.0.0.1:8000", "127.0.0.2:8000", "127.255.255.254:8000", "localhost:8000", "[::1]:8000",
     "[0:0:0:0:0:0:0:1]:8000", "LOCALHOST:8000"],
)  # fmt: skip
def test_names_of_this_machine_are_taken(host):
    LOCAL.check_host(host)


@pytest.mark.parametrize(
    "host",
    [
        "", "evil.com", "evil.com:8000", "127.0.0.1", "127.0.0.1:80", "127.0.0.1:8001",
        "127.0.0.1.evil.com:8000", "localhost.evil.com:8000", "evil.com#127.0.0.1:8000",
        "192.168.1.5:8000", "0.0.0.0:8000",
        "127.0.0.1:8000:1", "user@127.0.0.1:8000", "127.0.0.1:08000", "[", "]", "[]", "[:8000", "[::1",
        "\xff:8000", "::8000", "127.0.0.1:", "127.0.0.1:²", ":8000", "127.0.0.1:" + "9" * 5000,
    ],
)  # fmt: skip
def test_other_hosts_are_refused(host):
    with pytest.raises(ForbiddenError):
        LOCAL.check_host(host)


def test_an_open_studio_takes_addresses_but_no_other_names():
    OPEN.check_host("192.168.1.5:8000")
    with pytest.raises(ForbiddenError):
        OPEN.check_host("evil.com:8000")


@pytest.mark.parametrize(
    "host", ["127.0.0.1", "127.0.0.2", "::1", "localhost", "0.0.0.0", "::", "192.168.1.5", "Studio.local"]
)
def test_the_address_that_is_printed_is_served(host):
    access = Access.of(host, 8000)
    shown = urlsplit(access.address).netloc
    access.check_host(shown)
    access.check_host(shown.lower())  # as browsers send it


@pytest.mark.parametrize("origin", ["http://127.0.0.1:8000", None])
def test_the_own_page_and_programs_are_taken(origin):
    LOCAL.check_origin(origin, "127.0.0.1:8000")


@pytest.mark.parametrize(
    "origin",
    ["null", "", "http://evil.com", "http://127.0.0.1:8001", "https://127.0.0.1:8000", "http://localhost:8000",
     "http://127.0.0.1:8000.evil.com", "file://", "http://[", "http://]", "[", "\xff", "http://127.0.0.1:8000/"],
)  # fmt: skip
def test_pages_of_other_sites_are_refused(origin):
    with pytest.raises(ForbiddenError):
        LOCAL.check_origin(origin, "127.0.0.1:8000")


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.5", "::1", "localhost"])
def test_this_machine_alone_needs_no_token(host):
    assert is_loopback(host) and Access.of(host, 1).token == ""


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.5", "example.org"])
def test_other_addresses_have_a_random_token(host):
    one, other = Access.of(host, 1), Access.of(host, 1)
    assert len(one.token) >= 32 and one.token != other.token
    assert one.address.endswith(f"?token={one.token}")


def test_the_token_is_checked():
    LOCAL.check_token(None)
    OPEN.check_token("secret")
    for token in (None, "", "Secret", "secret ", "sécret"):
        with pytest.raises(ForbiddenError):
            OPEN.check_token(token)
