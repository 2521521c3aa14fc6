"""Who is asked where an object is in a picture: any OpenAI-compatible endpoint."""

from __future__ import annotations

import base64
import io
import os
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Protocol
from urllib.parse import urlsplit

import msgspec

from prior_reinforce.environment import Picture
from prior_reinforce.errors import ConfigurationError, EndpointError
from prior_reinforce.extras import check_installed
from prior_reinforce.perception.vlm_formats import FORMATS, Family
from prior_reinforce.perception.vlm_reading import Answer
from prior_reinforce.settings import Checked, Count, NonNegative, Positive

_NO_KEY = "EMPTY"
_MOST_SHOWN = 160
"""Characters of a server's own words in a message."""
_THIS_MACHINE = {"127.0.0.1", "localhost", "::1"}


@dataclass(frozen=True)
class VisionLanguageModelConfig(Checked):
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
    votes: Count = 3
    """Readable answers wanted for each object; the median of three forgives one outlier."""
    most_requests: Count = 7
    """Requests for each object before the operator is asked."""
    spread_gate: Positive = 0.01
    """More than half of the answers lie within this distance of their median, or they do not
    agree, in [m]. 1 cm (ours): the order of the tasks' tolerances."""
    temperature: NonNegative = 0.7
    """Sampling temperature (ours). At 0 all votes are one answer, and voting means nothing."""
    max_tokens: Count = 2048
    """Longest answer, thinking included."""
    timeout: Positive = 60.0
    """For a connection, and from one part of an answer to the next, in [s]."""
    max_retries: Annotated[int, msgspec.Meta(ge=0, le=20)] = 2
    """Repetitions of a request after a timeout, a lost connection, HTTP 429 or 5xx."""
    max_image_side: Count = 1000
    """Larger pictures are shrunk before they are sent, in [px]: the scale is no finer."""

    def __post_init__(self) -> None:
        without_secrets(self.base_url)
        if self.family not in FORMATS:
            raise ConfigurationError(
                f"model family '{self.family}' is unknown; use one of {', '.join(FORMATS)}"
            )
        super().__post_init__()
        if self.votes > self.most_requests:
            raise ConfigurationError(
                f"{self.votes} votes in at most {self.most_requests} requests; expected "
                "votes <= most_requests"
            )


class _Message(msgspec.Struct):
    content: str | None = None
    reasoning_content: str | None = None


class _Choice(msgspec.Struct):
    message: _Message
    finish_reason: str | None = None


class _Completion(msgspec.Struct):
    """What is read of a chat completion; the client does not check what a server sends."""

    choices: list[_Choice]


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
        check_installed("openai")
        import openai

        self.config, self.model = config, config.model
        self._key = _NO_KEY  # the client insists on one; servers that want none take any
        if config.api_key_variable is not None:
            self._key = os.environ.get(config.api_key_variable, "")
            if not self._key:
                raise ConfigurationError(
                    f"environment variable {config.api_key_variable} is not set; export the key of "
                    f"{without_secrets(config.base_url)} in it"
                )
        self._client = openai.OpenAI(
            base_url=config.base_url,
            api_key=self._key,
            timeout=config.timeout,
            max_retries=config.max_retries,
            http_client=openai.DefaultHttpxClient(
                # A proxy, set for the internet at large, does not know a server on this machine.
                trust_env=urlsplit(config.base_url).hostname not in _THIS_MACHINE,
                # A redirection would send the picture, and maybe the key, somewhere else.
                follow_redirects=False,
            ),
        )
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
        try:
            response = self._client.chat.completions.with_raw_response.create(
                model=self.config.model,
                messages=[{"role": "user", "content": content}],
                temperature=self.config.temperature,
                max_tokens=self.config.max_tokens,
                extra_body=_extra_body(self.config),
            )
            choice = msgspec.json.decode(response.content, type=_Completion).choices[0]
        # Whatever a server sends, the client's parsing included, is no reason to break off.
        except Exception as error:
            raise EndpointError(self._what_failed(error)) from None
        thinking, reason = choice.message.reasoning_content, choice.finish_reason
        return Answer(
            self._hidden(choice.message.content or ""),
            None if thinking is None else self._hidden(thinking),
            None if reason is None else self._hidden(reason),
        )

    def close(self) -> None:
        """Close the connections."""
        self._client.close()

    def _hidden(self, text: str) -> str:
        """A text without the key, which a server may send back."""
        return text if self._key == _NO_KEY else text.replace(self._key, "***")

    def _what_failed(self, error: Exception) -> str:
        """One line with the remedy for each way in which a request fails."""
        import openai

        config = self.config
        url, tries = without_secrets(config.base_url), f"after {config.max_retries + 1} tries"
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
        # The key is hidden before anything is cut: the rest of it would be no longer found.
        said = " ".join(self._hidden(str(error)).split())[:_MOST_SHOWN]
        if isinstance(error, openai.APIStatusError):
            return f"{url} failed with HTTP {error.status_code} ({said}); see the server's log"
        return (
            f"{url} answers, but not with a chat completion ({said}); the address of an "
            "OpenAI-compatible endpoint mostly ends in /v1"
        )


def _png_address(picture: Picture) -> str:
    from PIL import Image

    data = io.BytesIO()
    Image.fromarray(picture).save(data, format="PNG")
    return f"data:image/png;base64,{base64.b64encode(data.getvalue()).decode()}"


def _extra_body(config: VisionLanguageModelConfig) -> dict[str, Any]:
    if config.server == "vllm":
        # The markers around the box are special tokens, which vLLM strips unless told otherwise.
        thinking = {"enable_thinking": config.enable_thinking}
        return {"chat_template_kwargs": thinking, "skip_special_tokens": False}
    if config.server == "zai":
        return {"thinking": {"type": "enabled" if config.enable_thinking else "disabled"}}
    return {}


def without_secrets(url: str) -> str:
    """Return an address without a user's name, password, query and fragment.

    Raises:
        ConfigurationError: It is no address; what may hold a secret then is not shown.
    """
    try:
        address = urlsplit(url)
        usable = address.scheme in ("http", "https") and bool(address.hostname)
        _ = address.port
    except ValueError:
        usable = False
    # A second "@", or one behind the host, means that a password was cut in the wrong place.
    if not usable or url.count("@") > ("@" in address.netloc):
        shown = "that was given" if set(url) & set("@?#") else repr(url)
        raise ConfigurationError(
            f"the base_url {shown} is no address; give one such as http://127.0.0.1:8000/v1"
        )
    return f"{address.scheme}://{address.netloc.rpartition('@')[2]}{address.path}"
