"""Who is asked where an object is in a picture: any OpenAI-compatible endpoint."""

from __future__ import annotations

import base64
import io
import math
import os
import re
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Literal, Protocol, TypeVar
from urllib.parse import urlsplit

from prior_reinforce.environment import Picture
from prior_reinforce.errors import ConfigurationError, EndpointError, MissingExtraError
from prior_reinforce.perception.vlm_formats import FORMATS, Family
from prior_reinforce.perception.vlm_reading import Answer

T = TypeVar("T")
_NO_KEY = "EMPTY"
_MOST_BYTES = 4_000_000
"""Of a response; ours: a hundred times the longest answer with all its thinking."""
_MOST_RETRIES = 20
_PAUSE = 10.0
"""Between two tries at most, in [s]: openai waits up to 8 s by itself."""
_THIS_MACHINE = {"127.0.0.1", "localhost", "::1"}


@dataclass(frozen=True)
class VisionLanguageModelConfig:
    """Where the model is, its format, and when its answers are accepted."""

    base_url: str = "http://127.0.0.1:8000/v1"
    """OpenAI-compatible endpoint; the default is where vLLM and SGLang serve."""
    model: str = "zai-org/GLM-4.5V"
    """Name of the model at the endpoint."""
    family: Family = "glm-4.5v"
    """How the model is asked and in which scale it answers; cannot be told from its answers."""
    server: Literal["vllm", "zai", "plain"] = "vllm"
    """How thinking is switched: as vLLM and SGLang do, as Z.ai does, or not at all, for servers
    that refuse fields they do not know."""
    api_key_variable: str | None = None
    """Environment variable that holds the key; None for a server that wants none."""
    enable_thinking: bool = False
    """Let the model think first: slower, and `max_tokens` must be enough to finish."""
    votes: int = 3
    """Readable answers wanted for each object; the median of three forgives one outlier."""
    most_requests: int = 7
    """Requests for each object before the operator is asked."""
    spread_gate: float = 0.01
    """More than half of the answers lie within this distance of their median, or they do not
    agree, in [m]. 1 cm (ours): the order of the tasks' tolerances."""
    temperature: float = 0.7
    """Of the model's sampling (ours). At 0 all votes are one answer, and voting means nothing."""
    max_tokens: int = 2048
    """Longest answer, thinking included."""
    timeout: float = 60.0
    """For one request, in [s], however its answer trickles in."""
    max_retries: int = 2
    """Repetitions of a request after a timeout, a lost connection, HTTP 429 or 5xx."""
    max_image_side: int = 1000
    """Larger pictures are shrunk before they are sent, in [px]: the scale is no finer."""

    def __post_init__(self) -> None:
        try:
            address = urlsplit(self.base_url)
            usable = address.scheme in ("http", "https") and bool(address.hostname)
            _ = address.port
        except ValueError:
            usable = False
        if not usable:
            raise ConfigurationError(
                f"base_url {without_secrets(self.base_url)!r} is no address; give one such as "
                "http://127.0.0.1:8000/v1"
            )
        if self.family not in FORMATS:
            raise ConfigurationError(
                f"model family '{self.family}' is unknown; use one of {', '.join(FORMATS)}"
            )
        if not 1 <= self.votes <= self.most_requests:
            raise ConfigurationError(
                f"{self.votes} votes in at most {self.most_requests} requests; expected "
                "1 <= votes <= most_requests"
            )
        for name in ("spread_gate", "timeout", "max_tokens", "max_image_side"):
            if not 0 < getattr(self, name) < math.inf:
                raise ConfigurationError(
                    f"{name} = {getattr(self, name)} must be greater than zero; leave it out for "
                    "the default"
                )
        if not (0 <= self.max_retries <= _MOST_RETRIES and 0 <= self.temperature < math.inf):
            raise ConfigurationError(
                f"max_retries = {self.max_retries} must be 0 to {_MOST_RETRIES}, temperature = "
                f"{self.temperature} finite and not negative; use 0 for none"
            )


class ModelClient(Protocol):
    """Answers where an object is in a picture."""

    @property
    def model(self) -> str:
        """Who answers, for the record."""

    def ask(self, words: str, picture: Picture) -> Answer:
        """Ask for one object.

        Args:
            words: The object, for instance `the orange ball`.
            picture: RGB, of the size in which it shall be seen.

        Returns:
            The words of the answer; nobody has looked for a box in them yet.

        Raises:
            EndpointError: Nothing came back, and trying again at once will not help.
        """

    def close(self) -> None:
        """Close the connections."""


class OpenAIClient:
    """Asks an OpenAI-compatible endpoint, see `ModelClient`."""

    def __init__(self, config: VisionLanguageModelConfig) -> None:
        """Prepare the connection; nothing is sent yet.

        Raises:
            MissingExtraError: The extra [vlm] is not installed.
            ConfigurationError: The variable that should hold the key is not set.
        """
        try:
            import openai
        except ImportError as error:
            raise MissingExtraError(
                "perception by a vision-language model needs the openai client; install it with: "
                "pip install 'prior-reinforce[vlm]'"
            ) from error
        self.config = config
        self.model = config.model
        # A proxy, set for the internet at large, does not know a server on this machine.
        is_here = urlsplit(config.base_url).hostname in _THIS_MACHINE
        key = _key(config)
        http = import_module(openai.DefaultHttpxClient.__mro__[1].__module__.partition(".")[0])
        self._client = openai.OpenAI(
            base_url=config.base_url,
            api_key=key,
            timeout=config.timeout,
            max_retries=config.max_retries,
            # A redirection would send the picture, and maybe the key, somewhere else.
            http_client=openai.DefaultHttpxClient(
                trust_env=not is_here,
                follow_redirects=False,
                headers={"Accept-Encoding": "identity"},
                event_hooks={"response": [_bounded(http)]},
            ),
        )
        self._key = key
        self._sent: tuple[object, str] = (None, "")

    def ask(self, words: str, picture: Picture) -> Answer:
        """See `ModelClient.ask`."""
        if self._sent[0] is not picture:  # the same picture is asked about several times
            self._sent = (picture, _png_address(picture))
        prompt = FORMATS[self.config.family].prompt.format(words=words)
        content: list[Any] = [
            {"type": "image_url", "image_url": {"url": self._sent[1]}},
            {"type": "text", "text": prompt},
        ]

        def request() -> object:
            return self._client.chat.completions.create(
                model=self.config.model,
                messages=[{"role": "user", "content": content}],
                temperature=self.config.temperature,
                max_tokens=self.config.max_tokens,
                extra_body=_extra_body(self.config),
            )

        try:
            completion = _within(_longest(self.config), request)
        # Whatever a server sends, the client's parsing included, is no reason to break off.
        except Exception as error:
            said = self._hidden(_what_failed(error, self.config))
            raise EndpointError(said) from None
        return self._answer(completion)

    def close(self) -> None:
        """Close the connections."""
        self._client.close()

    def _answer(self, completion: object) -> Answer:
        """What a completion says, of whatever types a server has made it."""
        # The client's types promise choices; servers do not (a web page with status 200).
        choices: Any = getattr(completion, "choices", None)
        choices = choices if isinstance(choices, list) else []
        message = getattr(choices[0], "message", None) if choices else None
        if message is None:
            raise EndpointError(
                f"{without_secrets(self.config.base_url)} answers, but not with a chat "
                "completion; the address of an OpenAI-compatible endpoint mostly ends in /v1"
            )
        content = getattr(message, "content", None)
        thinking = getattr(message, "reasoning_content", None)
        finish = getattr(choices[0], "finish_reason", None)
        return Answer(
            self._hidden(content) if isinstance(content, str) else "",
            self._hidden(thinking) if isinstance(thinking, str) else None,
            finish if isinstance(finish, str) else None,
        )

    def _hidden(self, text: str) -> str:
        """A text without the key, which a server may send back."""
        return text if self._key == _NO_KEY else text.replace(self._key, "***")


class _NotThatMuchError(Exception):
    """A response is larger than any chat completion, or packed, so that its size is unknown."""


def _bounded(http: Any) -> Callable[[Any], None]:
    """A hook that lets no more of a response be read than a chat completion can be.

    Args:
        http: The library that openai sends its requests with: httpx, or what follows it.
    """

    def bound(response: Any) -> None:
        stream = response.stream

        class Bounded(http.SyncByteStream):  # type: ignore[misc]
            def __iter__(self) -> Iterator[bytes]:
                received = 0
                for part in stream:
                    received += len(part)
                    if received > _MOST_BYTES:
                        raise _NotThatMuchError(f"more than {_MOST_BYTES} bytes")
                    yield part

            def close(self) -> None:
                stream.close()

        response.stream = Bounded()
        if response.headers.get("Content-Encoding", "identity").lower() != "identity":
            raise _NotThatMuchError("packed, though asked for as it is")

    return bound


def _png_address(picture: Picture) -> str:
    from PIL import Image

    data = io.BytesIO()
    Image.fromarray(picture).save(data, format="PNG")
    return f"data:image/png;base64,{base64.b64encode(data.getvalue()).decode()}"


def _key(config: VisionLanguageModelConfig) -> str:
    if config.api_key_variable is None:
        return _NO_KEY  # the client insists on one; servers that want none take any
    key = os.environ.get(config.api_key_variable, "")
    if not key:
        raise ConfigurationError(
            f"environment variable {config.api_key_variable} is not set; export the key of "
            f"{without_secrets(config.base_url)} in it"
        )
    return key


def _extra_body(config: VisionLanguageModelConfig) -> dict[str, Any]:
    if config.server == "vllm":
        # The markers around the box are special tokens, which vLLM strips unless told otherwise.
        thinking = {"enable_thinking": config.enable_thinking}
        return {"chat_template_kwargs": thinking, "skip_special_tokens": False}
    if config.server == "zai":
        return {"thinking": {"type": "enabled" if config.enable_thinking else "disabled"}}
    return {}


def _what_failed(error: Exception, config: VisionLanguageModelConfig) -> str:
    """One line with the remedy for each way in which a request fails."""
    import openai

    url, tries = without_secrets(config.base_url), f"after {config.max_retries + 1} tries"
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, _NotThatMuchError):
            return f"{url} gave an answer that is not the protocol's ({cause}); see its log"
        cause = cause.__cause__ or cause.__context__
    if isinstance(error, TimeoutError):
        return f"no answer from {url} in {_longest(config):g} s {tries}; raise timeout"
    if isinstance(error, openai.APITimeoutError):
        return f"no answer from {url} in {config.timeout:g} s {tries}; raise timeout"
    if isinstance(error, openai.APIConnectionError):
        return f"cannot reach {url} {tries}; is the server running?"
    if isinstance(error, openai.RateLimitError):
        return f"{url} refuses more requests for now (HTTP 429) {tries}; wait a minute"
    if isinstance(error, openai.AuthenticationError):
        return f"{url} refuses the key (HTTP 401); set api_key_variable"
    if isinstance(error, openai.NotFoundError):
        return f"{url} does not serve model '{config.model}' (HTTP 404); set base_url and model"
    if isinstance(error, openai.APIStatusError):
        said = " ".join(str(error).split())[:160]
        return f"{url} failed with HTTP {error.status_code} ({said}); see the server's log"
    said = " ".join(str(error).split())[:160]
    return f"{url} gave an answer that is not the protocol's ({said}); is it the right address?"


def _longest(config: VisionLanguageModelConfig) -> float:
    """Of asking once, in [s]: every try, and the pauses between them."""
    return config.timeout * (config.max_retries + 1) + _PAUSE * config.max_retries


def _within(seconds: float, request: Callable[[], T]) -> T:
    """What a request gives, unless that takes longer: its own limits count from byte to byte.

    Raises:
        TimeoutError: It does; the thread that waits for it is left to itself.
    """
    given: Future[T] = Future()

    def fetch() -> None:
        try:
            given.set_result(request())
        except BaseException as error:
            given.set_exception(error)

    threading.Thread(target=fetch, daemon=True).start()
    try:
        return given.result(seconds)
    except FutureTimeoutError as error:
        raise TimeoutError from error


def without_secrets(url: str) -> str:
    """An address without a user's name, password or query."""
    return re.sub(r"//[^/@]*@", "//", url.partition("?")[0])
