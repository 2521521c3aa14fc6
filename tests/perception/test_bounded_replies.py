"""An answer is read within a time and up to a size, whatever a server does."""

import gzip
import json
import time

import pytest

from prior_reinforce.errors import EndpointError
from tests.perception.test_vlm_client import OK, ask, body, endpoint


def heads_without_end(file):
    file.write(b"HTTP/1.1 200 OK\r\n")
    while True:
        file.write(b"X")
        time.sleep(0.05)


def body_without_end(file):
    file.write(OK + b"Content-Length: 9999\r\n\r\n")
    while True:
        file.write(b" ")
        time.sleep(0.05)


@pytest.mark.parametrize("reply", [heads_without_end, body_without_end])
def test_an_answer_that_trickles_is_waited_for_no_longer_than_the_timeout(reply):
    with (
        endpoint(reply) as (address, _),
        pytest.raises(EndpointError, match=r"no answer from .* in 0.3 s after one try"),
    ):
        ask(address, timeout=0.3)


@pytest.mark.parametrize("status", [b"200 OK", b"500 Oh"])
@pytest.mark.parametrize("packed", [True, False])
def test_an_answer_is_read_up_to_a_size(status, packed):
    content = json.dumps({"choices": [{"message": {"content": "x" * 20_000_000}}]}).encode()
    large = body(gzip.compress(content), Content_Encoding="gzip") if packed else body(content)
    with (
        endpoint(lambda file: file.write(large.replace(b"200 OK", status))) as (address, _),
        pytest.raises(EndpointError, match="more than 270336 bytes; raise max_tokens"),
    ):
        ask(address)
