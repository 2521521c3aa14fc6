"""A stand-in for a vision-language model: a server that finds objects by colour. It is no model.

It speaks the OpenAI protocol on 127.0.0.1, decodes the very PNG it is sent, finds the object it is
asked for by colour, and answers in the format of a model family, in that family's scale. So the
whole way from physics to pixels, boxes, metres and the adapter is real; only the eyesight is not a
model's. Where a person has GLM-4.5V, its endpoint takes this one's place.
"""

from __future__ import annotations

import base64
import contextlib
import io
import json
import re
import threading
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np
from PIL import Image
from typing_extensions import Self

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.perception.colour_finder import find_by_colour
from prior_reinforce.perception.vlm_formats import FORMATS, Box, Family

_PATH = "/v1/chat/completions"
_QWEN25_PATCH = 28
"""Qwen2.5-VL's processor resizes a picture to multiples of this and counts in its pixels, [px]."""


@dataclass(frozen=True)
class Reply:
    """What goes back over HTTP."""

    status: int
    """HTTP status."""
    content: dict[str, Any] | str
    """JSON, or the text of a web page."""


class StandInServer:
    """The server, as a context manager: it runs on a free port from entering to leaving.

    The same requests in the same order get the same answers.

    Attributes:
        base_url: Endpoint to give to a client.
    """

    def __init__(
        self, family: Family = "glm-4.5v", *, outlier_rate: float = 0.0, seed: int = 0
    ) -> None:
        """Take a free port; nothing is answered before the context is entered.

        Args:
            family: In whose format to answer.
            outlier_rate: Share of answers whose box, of the right size, lies anywhere.
            seed: Of which answers those are, and where their boxes lie.

        Raises:
            ConfigurationError: The rate is no share, or the family is unknown.
        """
        if not 0 <= outlier_rate <= 1 or family not in FORMATS:
            raise ConfigurationError(
                f"outlier_rate = {outlier_rate} and family = {family!r}: expected a share from 0 "
                f"to 1 and one of {', '.join(FORMATS)}"
            )
        self.family = family
        self._outlier_rate = outlier_rate
        self._rng = np.random.default_rng(seed)
        self._found: dict[tuple[str, str], tuple[Box | None, tuple[int, int]]] = {}
        self._lock = threading.Lock()
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), _handler_for(self))
        self._server.daemon_threads = True
        self.base_url = f"http://127.0.0.1:{self._server.server_port}/v1"

    def __enter__(self) -> Self:
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,))
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def reply(self, path: str, headers: dict[str, str], body: dict[str, Any]) -> Reply | None:
        """Answer one request; None hangs up without a word.

        Args:
            path: What was asked for.
            headers: By their names in lower case.
            body: The request, decoded.
        """
        with self._lock:
            astray = self._rng.random() < self._outlier_rate
            if path != _PATH:
                return Reply(404, {"error": {"message": f"no such path {path}"}})
            try:
                return completion(body["model"], [self.choice(body, astray=astray)])
            except ConfigurationError as error:
                return Reply(400, {"error": {"message": str(error)}})

    def choice(self, body: dict[str, Any], *, astray: bool = False) -> dict[str, Any]:
        """Look at a request's picture and make the completion's `choices[0]`.

        Args:
            body: The request.
            astray: Put the box anywhere.
        """
        box, size, words = self.look(body)
        if box is not None and astray:
            box = self.elsewhere(box, size)
        message = {"role": "assistant", "content": self.say(box, size, words)}
        return {"index": 0, "finish_reason": "stop", "message": message}

    def look(self, body: dict[str, Any]) -> tuple[Box | None, tuple[int, int], str]:
        """Return the box of what is asked for, the picture's size in [px], and the words."""
        parts = {part["type"]: part for part in body["messages"][0]["content"]}
        url = parts["image_url"]["image_url"]["url"]
        words = _asked_for(parts["text"]["text"])
        if (url, words) not in self._found:  # the same picture is asked about several times
            data = base64.b64decode(url.removeprefix("data:image/png;base64,"), validate=True)
            picture = np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))
            size = (picture.shape[1], picture.shape[0])
            self._found = {(url, words): (find_by_colour(picture, words), size)}
        return *self._found[url, words], words

    def elsewhere(self, box: Box, size: tuple[int, int]) -> Box:
        """A box of the same size anywhere in the picture."""
        width, height = box[2] - box[0], box[3] - box[1]
        left = self._rng.uniform(0, size[0] - width)
        top = self._rng.uniform(0, size[1] - height)
        return left, top, left + width, top + height

    def numbers(self, box: Box, size: tuple[int, int]) -> list[int]:
        """A box in the family's scale, as the model would count."""
        seen = [1000, 1000]
        if FORMATS[self.family].scale == "pixels":
            seen = [_QWEN25_PATCH * round(side / _QWEN25_PATCH) for side in size]
        return [round(v * seen[i % 2] / size[i % 2]) for i, v in enumerate(box)]

    def say(self, box: Box | None, size: tuple[int, int], words: str) -> str:
        """The answer in the family's format; an empty list for no box."""
        numbers = None if box is None else self.numbers(box, size)
        if self.family == "glm-4.5v":
            found = json.dumps([] if numbers is None else [numbers])
            return f"The bounding box is <|begin_of_box|>{found}<|end_of_box|>."
        labelled = [] if numbers is None else [{"bbox_2d": numbers, "label": words}]
        return f"```json\n{json.dumps(labelled)}\n```"


def completion(model: str, choices: list[dict[str, Any]]) -> Reply:
    """Wrap choices in what the protocol calls a completion."""
    usage = {"prompt_tokens": 0, "completion_tokens": 0, "total_tokens": 0}
    content = {"id": "stand-in", "object": "chat.completion", "created": 0, "model": model}
    return Reply(200, {**content, "choices": choices, "usage": usage})


def _asked_for(prompt: str) -> str:
    match = re.search(r"ocate (.+?) in the image", prompt)
    if match is None:
        raise ConfigurationError(f"no object is named in the prompt {prompt!r}")
    return match[1]


def _handler_for(vision: StandInServer) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        wbufsize = -1  # one segment an answer: two wait 40 ms for an acknowledgement

        def do_POST(self) -> None:
            body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            headers = {name.lower(): value for name, value in self.headers.items()}
            reply = vision.reply(self.path, headers, body)
            # The client may have given up meanwhile, as it should on a timeout.
            with contextlib.suppress(BrokenPipeError, ConnectionResetError):
                if reply is None:
                    self.close_connection = True
                else:
                    self._send(reply)

        def _send(self, reply: Reply) -> None:
            is_page = isinstance(reply.content, str)
            data = reply.content if isinstance(reply.content, str) else json.dumps(reply.content)
            self.send_response(reply.status)
            self.send_header("Content-Type", "text/html" if is_page else "application/json")
            self.send_header("Content-Length", str(len(data.encode())))
            self.send_header("Retry-After-Ms", "1")
            self.end_headers()
            self.wfile.write(data.encode())

        def log_message(self, *_: object) -> None:
            """Stay silent."""

    return Handler
