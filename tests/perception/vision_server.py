"""The package's stand-in with what served models have been seen to do, injected on request.

Each `Fault` is one such thing.
"""

from __future__ import annotations

import json
import re
import threading
from collections import deque
from collections.abc import Iterable
from typing import Any, Literal, get_args

from prior_reinforce.perception.stand_in_server import Reply, StandInServer, completion
from prior_reinforce.perception.vlm_formats import Box, Family

Fault = Literal[
    "refusal", "empty", "truncated", "swapped corners", "out of range", "no area",
    "thinking in the text", "thinking kept apart", "thinking without end", "draft before",
    "markers stripped", "markers leaked", "end marker lost", "bracket style", "two objects",
    "null content", "outlier", "whole picture", "timeout", "dropped", "http 401", "http 404",
    "http 429", "http 500", "web page", "no choices",
]  # fmt: skip
FAULTS: tuple[Fault, ...] = get_args(Fault)


class VisionServer(StandInServer):
    """The stand-in, with faults.

    Attributes:
        requests: Bodies received, in order.
        headers: Their headers.
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
        super().__init__(family, outlier_rate=outlier_rate, seed=seed)
        self.requests: list[dict[str, Any]] = []
        self.headers: list[dict[str, str]] = []
        self.faults: deque[Fault | None] = deque(faults)
        self._closing = threading.Event()

    def __exit__(self, *_: object) -> None:
        self._closing.set()
        super().__exit__()

    def reply(self, path: str, headers: dict[str, str], body: dict[str, Any]) -> Reply | None:
        self.requests.append(body)
        self.headers.append(headers)
        fault = self.faults.popleft() if self.faults else None
        if fault is None:
            return super().reply(path, headers, body)
        if fault == "dropped":
            return None
        if fault == "timeout":
            self._closing.wait(2.0)
            return None
        if fault == "web page":
            return Reply(200, "<html>Welcome</html>")
        if fault == "no choices":
            return completion(body["model"], [])
        if fault.startswith("http "):
            return Reply(int(fault[5:]), {"error": {"message": fault}})
        choice = self.choice(body, astray=fault == "outlier")
        box, size, words = self.look(body)
        if box is not None:
            self._spoil(fault, choice, box, size, words)
        return completion(body["model"], [choice])

    def _spoil(
        self, fault: Fault, choice: dict[str, Any], box: Box, size: tuple[int, int], words: str
    ) -> None:
        message, said = choice["message"], choice["message"]["content"]
        x1, y1, x2, y2 = box
        numbers = self.numbers(box, size)
        draft = self.say(self.elsewhere(box, size), size, words)
        if fault == "refusal":
            message["content"] = "I'm sorry, but I can't help with locating objects."
        elif fault == "empty":
            message["content"] = self.say(None, size, words)
        elif fault == "truncated":
            message["content"] = draft + " But looking closer, I see that"
            choice["finish_reason"] = "length"
        elif fault == "swapped corners":
            message["content"] = self.say((x2, y2, x1, y1), size, words)
        elif fault == "out of range":
            message["content"] = self.say((x1, y1, x2 + 2 * size[0], y2), size, words)
        elif fault == "whole picture":
            message["content"] = self.say((0.0, 0.0, *size), size, words)
        elif fault == "no area":
            message["content"] = self.say((x1, y1, x1, y2), size, words)
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
            other = self.numbers(self.elsewhere(box, size), size)
            two = [numbers, other]
            if self.family != "glm-4.5v":
                two = [{"bbox_2d": n, "label": words} for n in two]
            message["content"] = json.dumps(two)
        elif fault == "null content":
            message["content"] = None
