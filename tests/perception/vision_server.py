"""A server for tests that speaks the OpenAI protocol: objects by colour, faults on request.

It runs on a free port of this machine, decodes the very PNG it is sent, answers as `ColourClient`
does, and can do what served models have been seen to do; each `Fault` is one such thing.
"""

from __future__ import annotations

import base64
import contextlib
import io
import json
import re
import threading
from collections import deque
from collections.abc import Iterable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Literal

import numpy as np
from PIL import Image

from prior_reinforce.errors import ConfigurationError
from prior_reinforce.perception.colour_camera import ColourClient, find_by_colour, say_box
from prior_reinforce.perception.vlm_formats import Box, Family

Fault = Literal[
    "refusal", "empty", "truncated", "swapped corners", "out of range", "no area",
    "thinking in the text", "thinking kept apart", "thinking without end", "draft before",
    "markers stripped", "markers leaked", "end marker lost", "bracket style", "two objects",
    "null content", "outlier", "whole picture", "timeout", "dropped", "http 401", "http 404",
    "http 429", "http 500", "web page", "no choices",
]  # fmt: skip
Reply = tuple[int, dict[str, Any] | str]
"""HTTP status, and JSON or the text of a web page."""


class VisionServer:
    """The server, as a context manager: it runs from entering to leaving.

    Attributes:
        base_url: Endpoint to give to a client.
        requests: Bodies received, in order.
        headers: Their headers, by names in lower case.
        faults: What to do to the coming answers, first in first out; None for nothing.
    """

    def __init__(
        self,
        family: Family = "glm-4.5v",
        *,
        faults: Iterable[Fault | None] = (),
        outlier_rate: float = 0.0,
        seed: int = 0,
    ) -> None:
        self.family = family
        self.requests: list[dict[str, Any]] = []
        self.headers: list[dict[str, str]] = []
        self.faults: deque[Fault | None] = deque(faults)
        self._client = ColourClient(family, outlier_rate=outlier_rate, seed=seed)
        self._pictures: dict[str, np.ndarray] = {}
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), _handler_for(self))
        self._server.daemon_threads = True
        self.base_url = f"http://127.0.0.1:{self._server.server_port}/v1"

    def __enter__(self) -> VisionServer:
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,))
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closing.set()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def reply(self, headers: dict[str, str], body: dict[str, Any]) -> Reply | None:
        """Answer one request; None hangs up without a word."""
        self.requests.append(body)
        self.headers.append(headers)
        fault = self.faults.popleft() if self.faults else None
        if fault == "dropped":
            return None
        if fault == "timeout":
            self._closing.wait(2.0)
            return None
        if fault == "web page":
            return 200, "<html>Welcome</html>"
        if fault == "no choices":
            return _completion(body["model"], [])
        if fault is not None and fault.startswith("http "):
            return int(fault[5:]), {"error": {"message": fault}}
        parts = {part["type"]: part for part in body["messages"][0]["content"]}
        picture = self._decoded(parts["image_url"]["image_url"]["url"])
        asked = re.search(r"ocate (.+?) in the image", parts["text"]["text"])
        assert asked is not None
        try:
            with self._lock:
                said = self._client.ask(asked[1], picture).text
        except ConfigurationError as error:
            return 400, {"error": {"message": str(error)}}
        choice = {"index": 0, "finish_reason": "stop", "message": {"role": "assistant"}}
        choice["message"]["content"] = said
        box = find_by_colour(picture, asked[1])
        if fault is not None and box is not None:
            self._spoil(fault, choice, box, (picture.shape[1], picture.shape[0]), asked[1])
        return _completion(body["model"], [choice])

    def _decoded(self, url: str) -> np.ndarray:
        if url not in self._pictures:  # the same picture is asked about several times
            data = base64.b64decode(url.removeprefix("data:image/png;base64,"), validate=True)
            self._pictures = {url: np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))}
        return self._pictures[url]

    def _spoil(
        self, fault: Fault, choice: dict[str, Any], box: Box, size: tuple[int, int], words: str
    ) -> None:
        def say(box: Box | None) -> str:
            return say_box(box, size, words, self.family)

        message = choice["message"]
        said, (x1, y1, x2, y2) = message["content"], box
        # Of the same size, in the corner of the picture that is further away.
        left = 0.0 if x1 + x2 > size[0] else size[0] - (x2 - x1)
        top = 0.0 if y1 + y2 > size[1] else size[1] - (y2 - y1)
        elsewhere = (left, top, left + x2 - x1, top + y2 - y1)
        draft = say(elsewhere)
        found = re.findall(r"\[(\d+), (\d+), (\d+), (\d+)\]", said + draft)
        here, two = found[0], [[int(number) for number in numbers] for numbers in found]
        if self.family != "glm-4.5v":
            two = [{"bbox_2d": numbers, "label": words} for numbers in two]
        if fault == "truncated":
            choice["finish_reason"] = "length"
        if fault == "thinking kept apart":
            message["reasoning_content"] = f"Perhaps {draft}"
            return
        message["content"] = {
            "refusal": "I'm sorry, but I can't help with locating objects.",
            "empty": say(None),
            "outlier": draft,
            "truncated": draft + " But looking closer, I see that",
            "swapped corners": say((x2, y2, x1, y1)),
            "out of range": say((x1, y1, x2 + 2 * size[0], y2)),
            "whole picture": say((0.0, 0.0, *map(float, size))),
            "no area": say((x1, y1, x1, y2)),
            "thinking in the text": f"<think>Perhaps {draft} No, wait.</think>\n{said}",
            "thinking without end": f"<think>Perhaps {draft} No, wait. {said}",
            "draft before": f"{draft} Checking again, it is further on. {said}",
            "markers stripped": re.sub(r"<\|[a-z_]+\|>", "", said),
            "markers leaked": said + "<|user|>",
            "end marker lost": said.replace("<|end_of_box|>", ""),
            "bracket style": "<|begin_of_box|>({}, {}), ({}, {})<|end_of_box|>".format(*here),
            "two objects": json.dumps(two),
            "null content": None,
        }[fault]


def vlm_file(folder: Path, base_url: str, **settings: object) -> Path:
    """A file with the section [vlm] in it, for `--vlm`; a request is made once."""
    said = {"base_url": base_url, "max_retries": 0, **settings}
    path = folder / "vlm.toml"
    lines = [f"{name} = {json.dumps(value)}" for name, value in said.items()]
    path.write_text("\n".join(["[vlm]", *lines, ""]))
    return path


def _completion(model: str, choices: list[dict[str, Any]]) -> Reply:
    """Wrap choices in what the protocol calls a completion."""
    usage = {"prompt_tokens": 0, "completion_tokens": 0, "total_tokens": 0}
    content = {"id": "test", "object": "chat.completion", "created": 0, "model": model}
    return 200, {**content, "choices": choices, "usage": usage}


def _handler_for(vision: VisionServer) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        wbufsize = -1  # one segment an answer: two wait 40 ms for an acknowledgement

        def do_POST(self) -> None:
            body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            headers = {name.lower(): value for name, value in self.headers.items()}
            reply = vision.reply(headers, body)
            if self.path != "/v1/chat/completions":
                reply = 404, {"error": {"message": f"no such path {self.path}"}}
            # The client may have given up meanwhile, as it should on a timeout.
            with contextlib.suppress(BrokenPipeError, ConnectionResetError):
                if reply is None:
                    self.close_connection = True
                else:
                    self._send(*reply)

        def _send(self, status: int, content: dict[str, Any] | str) -> None:
            data = content if isinstance(content, str) else json.dumps(content)
            kind = "text/html" if isinstance(content, str) else "application/json"
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(data.encode())))
            self.send_header("Retry-After-Ms", "1")
            self.end_headers()
            self.wfile.write(data.encode())

        def log_message(self, *_: object) -> None:
            """Stay silent."""

    return Handler
