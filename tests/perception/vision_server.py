"""A stand-in for a vision-language model, for tests: a real server, a real picture, real failures.

It speaks the OpenAI protocol on 127.0.0.1, decodes the very PNG it is sent, finds the object it is
asked for by colour, and answers in the format of a model family. It knows nothing of the scene.
Faults are injected on request: each `Fault` is one thing that served models have been seen to do.
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
from typing import Any, Literal, get_args

import numpy as np
from PIL import Image
from scipy import ndimage

Fault = Literal[
    "refusal", "empty", "truncated", "swapped corners", "out of range", "no area",
    "thinking in the text", "thinking kept apart", "thinking without end", "draft before",
    "markers stripped", "markers leaked", "end marker lost", "bracket style", "two objects",
    "null content", "outlier", "whole picture", "timeout", "dropped", "http 401", "http 404",
    "http 429", "http 500", "web page", "no choices",
]  # fmt: skip
FAULTS: tuple[Fault, ...] = get_args(Fault)

# Hue in degrees, least saturation. Table, floor, arm and shadows of our scenes are all paler.
COLOURS = {
    "red": (-12.0, 10.0, 0.62),
    "orange": (14.0, 36.0, 0.72),
    "blue": (195.0, 245.0, 0.55),
    "yellow": (44.0, 60.0, 0.72),
}

Box = tuple[float, float, float, float]


def find_by_colour(picture: np.ndarray, words: str) -> Box | None:
    """Bounding box, in pixels, of what has the colour that the words name; None if nothing has.

    Specks do not count; pieces do, as something may lie across the object.

    Args:
        picture: Shape (height, width, 3), dtype uint8.
        words: For instance `the orange ball`.
    """
    low, high, least_saturation = COLOURS[_named_colour(words)]
    hue, saturation, value = np.moveaxis(np.asarray(Image.fromarray(picture).convert("HSV")), 2, 0)
    degrees = (hue * (360 / 256) - low) % 360 + low
    of_colour = (degrees <= high) & (saturation > 255 * least_saturation) & (value > 60)
    pieces, n_pieces = ndimage.label(of_colour, np.ones((3, 3)))
    areas = np.bincount(pieces.ravel(), minlength=n_pieces + 1)
    areas[0] = 0  # the background
    if areas.max() < 12:
        return None
    rows, columns = np.nonzero((areas > areas.max() / 5)[pieces])
    return float(columns.min()), float(rows.min()), columns.max() + 1.0, rows.max() + 1.0


def _named_colour(words: str) -> str:
    named = [colour for colour in COLOURS if re.search(rf"\b{colour}\b", words)]
    if len(named) != 1:
        raise ValueError(f"the stand-in finds one of {list(COLOURS)} and was asked for {words!r}")
    return named[0]


class VisionServer:
    """Context manager around the server.

    Attributes:
        requests: Bodies received, in order.
        faults: What to do to the coming answers, first in first out; None for nothing.
    """

    def __init__(
        self,
        family: str = "glm-4.5v",
        *,
        faults: Iterable[Fault | None] = (),
        outlier_rate: float = 0.0,
        seed: int = 0,
    ) -> None:
        self.family = family
        self.requests: list[dict[str, Any]] = []
        self.headers: list[dict[str, str]] = []
        self.faults: deque[Fault | None] = deque(faults)
        self._outlier_rate = outlier_rate
        self._rng = np.random.default_rng(seed)
        self._found: dict[tuple[str, str], tuple[Box | None, tuple[int, int]]] = {}
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

    def wait(self, seconds: float) -> None:
        self._closing.wait(seconds)

    def next_fault(self, body: dict[str, Any], headers: dict[str, str]) -> Fault | None:
        with self._lock:
            self.requests.append(body)
            self.headers.append(headers)
            is_outlier = self._rng.random() < self._outlier_rate
            if self.faults:
                return self.faults.popleft()
            return "outlier" if is_outlier else None

    def answer(self, body: dict[str, Any], fault: Fault | None) -> dict[str, Any]:
        """The completion's `choices[0]`, for a request's body."""
        url, prompt = _parts(body)
        words = re.search(r"ocate (.+?) in the image", prompt)[1]
        box, size = self._look(url, words)
        choice: dict[str, Any] = {"index": 0, "finish_reason": "stop"}
        message: dict[str, Any] = {"role": "assistant", "content": None}
        choice["message"] = message
        if box is not None and fault == "outlier":
            box = self._elsewhere(box, size)
        message["content"] = self._say(box, size, words)
        if fault is not None and box is not None:
            self._spoil(fault, choice, box, size, words)
        return choice

    def _look(self, url: str, words: str) -> tuple[Box | None, tuple[int, int]]:
        if (url, words) not in self._found:  # the same picture is asked about several times
            kind, data = url.split(",", 1)
            assert kind == "data:image/png;base64"
            picture = np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"))
            found = find_by_colour(picture, words), (picture.shape[1], picture.shape[0])
            self._found[url, words] = found
        return self._found[url, words]

    def _elsewhere(self, box: Box, size: tuple[int, int]) -> Box:
        width, height = box[2] - box[0], box[3] - box[1]
        left = self._rng.uniform(0, size[0] - width)
        top = self._rng.uniform(0, size[1] - height)
        return left, top, left + width, top + height

    def _numbers(self, box: Box, size: tuple[int, int]) -> list[int]:
        """In the family's scale, as the model would count."""
        if self.family == "qwen2.5-vl":  # absolute, after its processor's resizing
            seen = [28 * round(side / 28) for side in size]
        else:
            seen = [1000, 1000]
        return [round(v * seen[i % 2] / size[i % 2]) for i, v in enumerate(box)]

    def _say(self, box: Box | None, size: tuple[int, int], words: str) -> str:
        numbers = None if box is None else self._numbers(box, size)
        if self.family == "glm-4.5v":
            found = [] if numbers is None else [numbers]
            return f"The bounding box is <|begin_of_box|>{json.dumps(found)}<|end_of_box|>."
        found = [] if numbers is None else [{"bbox_2d": numbers, "label": words}]
        return f"```json\n{json.dumps(found)}\n```"

    def _spoil(
        self, fault: Fault, choice: dict[str, Any], box: Box, size: tuple[int, int], words: str
    ) -> None:
        message, said = choice["message"], choice["message"]["content"]
        x1, y1, x2, y2 = box
        numbers = self._numbers(box, size)
        draft = self._say(self._elsewhere(box, size), size, words)
        if fault == "refusal":
            message["content"] = "I'm sorry, but I can't help with locating objects."
        elif fault == "empty":
            message["content"] = self._say(None, size, words)
        elif fault == "truncated":
            message["content"] = draft + " But looking closer, I see that"
            choice["finish_reason"] = "length"
        elif fault == "swapped corners":
            message["content"] = self._say((x2, y2, x1, y1), size, words)
        elif fault == "out of range":
            message["content"] = self._say((x1, y1, x2 + 2 * size[0], y2), size, words)
        elif fault == "whole picture":
            message["content"] = self._say((0.0, 0.0, *size), size, words)
        elif fault == "no area":
            message["content"] = self._say((x1, y1, x1, y2), size, words)
        elif fault == "thinking in the text":
            message["content"] = f"<think>Perhaps {draft} No, wait.</think>\n{said}"
        elif fault == "thinking kept apart":
            message["reasoning_content"] = f"Perhaps {draft}"
        elif fault == "thinking without end":
            message["content"] = f"<think>Perhaps {draft} No, wait. {said}"
        elif fault == "draft before":
            message["content"] = f"{draft} Checking again, it is further on. {said}"
        elif fault == "markers stripped":
            message["content"] = re.sub(r"<\|[a-z_]+\|>", "", said)
        elif fault == "markers leaked":
            message["content"] = said + "<|user|>"
        elif fault == "end marker lost":
            message["content"] = said.replace("<|end_of_box|>", "")
        elif fault == "bracket style":
            message["content"] = "<|begin_of_box|>({}, {}), ({}, {})<|end_of_box|>".format(*numbers)
        elif fault == "two objects":
            other = self._numbers(self._elsewhere(box, size), size)
            two = [numbers, other]
            if self.family != "glm-4.5v":
                two = [{"bbox_2d": n, "label": words} for n in two]
            message["content"] = json.dumps(two)
        elif fault == "null content":
            message["content"] = None


def _parts(body: dict[str, Any]) -> tuple[str, str]:
    parts = {part["type"]: part for part in body["messages"][0]["content"]}
    return parts["image_url"]["image_url"]["url"], parts["text"]["text"]


def _handler_for(vision: VisionServer) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        wbufsize = -1  # one segment an answer: two wait 40 ms for an acknowledgement

        def do_POST(self) -> None:
            body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            headers = {name.lower(): value for name, value in self.headers.items()}
            fault = vision.next_fault(body, headers)
            # The client may have given up meanwhile, as it should on a timeout.
            with contextlib.suppress(BrokenPipeError, ConnectionResetError):
                self._respond(body, fault)

        def _respond(self, body: dict[str, Any], fault: Fault | None) -> None:
            if self.path != "/v1/chat/completions":
                self._send(404, {"error": {"message": f"no such path {self.path}"}})
            elif fault == "dropped":
                self.close_connection = True
            elif fault == "timeout":
                vision.wait(2.0)
                self.close_connection = True
            elif fault == "web page":
                self._send(200, "<html>Welcome</html>")
            elif fault == "no choices":
                self._send(200, _completion(body["model"], []))
            elif fault is not None and fault.startswith("http "):
                self._send(int(fault[5:]), {"error": {"message": fault}})
            else:
                self._send(200, _completion(body["model"], [vision.answer(body, fault)]))

        def _send(self, status: int, content: dict[str, Any] | str) -> None:
            is_page = isinstance(content, str)
            data = (content if is_page else json.dumps(content)).encode()
            self.send_response(status)
            self.send_header("Content-Type", "text/html" if is_page else "application/json")
            self.send_header("Content-Length", str(len(data)))
            self.send_header("Retry-After-Ms", "1")
            self.end_headers()
            self.wfile.write(data)

        def log_message(self, *_: object) -> None:
            pass

    return Handler


def _completion(model: str, choices: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "id": "stand-in",
        "object": "chat.completion",
        "created": 0,
        "model": model,
        "choices": choices,
        "usage": {"prompt_tokens": 0, "completion_tokens": 0, "total_tokens": 0},
    }
