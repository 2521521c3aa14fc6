"""HTTP whose answers have a largest size and a longest time, whatever a server does."""

from __future__ import annotations

from concurrent.futures import Future, TimeoutError
from threading import Thread
from typing import Any

import httpx

from prior_reinforce.errors import EndpointError


def post(
    client: httpx.Client, url: str, content: Any, *, seconds: float, most_bytes: int
) -> tuple[httpx.Response, bytes]:
    """Send JSON, and read the whole answer, which httpx bounds from one byte to the next only.

    Args:
        client: Who sends.
        url: Where to.
        content: Of JSON types.
        seconds: From the request to the end of its answer, at most.
        most_bytes: Of the answer, unpacked.

    Returns:
        The answer's head and its content, whatever its status.

    Raises:
        httpx.ReadTimeout: It took longer.
        EndpointError: It is larger.
    """
    answer: Future[tuple[httpx.Response, bytes]] = Future()

    def read() -> None:
        try:
            said = bytearray()
            with client.stream("POST", url, json=content) as response:
                for part in response.iter_bytes():
                    said += part
                    if len(said) > most_bytes:
                        raise EndpointError(f"an answer of more than {most_bytes} bytes")
            answer.set_result((response, bytes(said)))
        except Exception as error:
            answer.set_exception(error)

    # Nothing interrupts a socket from which a byte comes now and then; so it is left behind.
    Thread(target=read, daemon=True).start()
    try:
        return answer.result(seconds)
    except TimeoutError:
        raise httpx.ReadTimeout("the answer takes longer") from None
