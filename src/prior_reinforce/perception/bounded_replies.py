"""HTTP whose answers have a largest size and a longest time, whatever a server does."""

from __future__ import annotations

from collections.abc import Callable
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any

import httpx
import openai

from prior_reinforce.errors import EndpointError


class BoundedClient(openai.DefaultHttpxClient):
    """Reads every answer itself, errors included, within a time and up to a size.

    httpx has a timeout from one byte to the next, and no largest size.
    """

    def __init__(self, seconds: float, most_bytes: int, **settings: Any) -> None:
        """Connect to nothing yet.

        An answer may take so many seconds from its request to its end, and have `most_bytes`
        unpacked; `settings` are of `httpx.Client`.
        """
        super().__init__(**settings)
        self._seconds, self._most = seconds, most_bytes

    def send(  # type: ignore[override]
        self, request: httpx.Request, **how: Any
    ) -> httpx.Response:
        """Send a request; what it raises is also raised for an answer beyond a bound.

        httpx.ReadTimeout if it takes longer, EndpointError if it is larger.
        """
        answers: SimpleQueue[httpx.Response | Exception] = SimpleQueue()
        send = super().send
        # Nothing interrupts a socket from which a byte comes now and then; so it is left behind.
        Thread(target=self._answer, args=(send, request, how, answers), daemon=True).start()
        try:
            answer = answers.get(timeout=self._seconds)
        except Empty:
            raise httpx.ReadTimeout("the answer takes longer", request=request) from None
        if isinstance(answer, Exception):
            raise answer
        return answer

    def _answer(
        self,
        send: Callable[..., httpx.Response],
        request: httpx.Request,
        how: dict[str, Any],
        answers: SimpleQueue[httpx.Response | Exception],
    ) -> None:
        try:
            response = send(request, **how | {"stream": True})
            try:
                content = bytearray()
                for part in response.iter_bytes():
                    content += part
                    if len(content) > self._most:
                        raise EndpointError(f"an answer of more than {self._most} bytes")
            finally:
                response.close()
        except Exception as error:
            answers.put(error)
            return
        kept = [
            (name, value)
            for name, value in response.headers.multi_items()
            if name not in ("content-encoding", "content-length", "transfer-encoding")
        ]
        answers.put(
            httpx.Response(
                response.status_code, headers=kept, content=bytes(content), request=request
            )
        )
