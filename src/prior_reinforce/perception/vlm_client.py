"""Who is asked where an object is in a picture: any OpenAI-compatible endpoint."""

from __future__ import annotations

import base64
import codecs
import io
import math
import os
import ssl
from contextlib import suppress
from dataclasses import dataclass
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol, get_args
from urllib.parse import urljoin, urlsplit

import msgspec
from typing_extensions import Self

from prior_reinforce.environment import Picture
from prior_reinforce.errors import ConfigurationError, EndpointError, FileFormatError
from prior_reinforce.extras import check_installed
from prior_reinforce.perception.vlm_formats import FORMATS, Family
from prior_reinforce.perception.vlm_reading import Answer
from prior_reinforce.registry import build
from prior_reinforce.settings import Checked, Count, NonNegative, Positive, tomllib

_NO_KEY = "EMPTY"
_MOST_SHOWN = 300
"""Characters of a server's own words in a message."""
_MOST_BYTES, _BYTES_A_TOKEN = 65_536, 100
"""Of an answer; ours: ten times what any tokenizer makes of a token, in JSON's escapes."""
_HIDDEN = 8
"""Characters of a key in a row that nobody shows; ours: no shorter piece tells a key."""
_THIS_MACHINE = {"127.0.0.1", "localhost", "::1"}
_Field = Literal[
    "max_tokens", "temperature", "chat_template_kwargs", "skip_special_tokens", "thinking"
]
"""Of a request, which some servers refuse."""
_PROXIES = ("all_proxy", "http_proxy", "https_proxy")


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
    certificate: str | None = None
    """File (.pem) with the certificate of a server that signs its own."""
    leave_out: tuple[_Field, ...] = ()
    """Fields of the request that the server refuses: `max_tokens`, `temperature`, ..."""
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
    """Longest answer, thinking included; also bounds what is read of one, in bytes."""
    timeout: Positive = 60.0
    """For a request and the whole answer, in [s]."""
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

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, needed: bool = True) -> Self:
        """Read the section [vlm] of a TOML file: these settings by their names.

        Args:
            path: A file of its own, or a workspace's manifest.
            needed: Whether the section must be there; else the defaults stand for it.

        Raises:
            FileFormatError: There is no such file, it is no TOML, or it lacks the section.
            ConfigurationError: An unknown setting, or a value of a wrong type or out of range.
        """
        try:
            sections = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise FileFormatError(
                f"cannot read {path} ({error}); expected a TOML file with a section [vlm]"
            ) from error
        if needed and not isinstance(sections.get("vlm"), dict):
            raise FileFormatError(f"{path} has no section [vlm]; write base_url, model, ... there")
        settings: Self = build(cls, sections.get("vlm", {}), f"{path}: [vlm]")
        return settings


class _Part(msgspec.Struct):
    text: str | None = None
    type: str = "text"


class _Function(msgspec.Struct):
    arguments: Any = ""


class _Call(msgspec.Struct):
    function: _Function | None = None


class _Message(msgspec.Struct):
    content: str | list[_Part] | None = None
    refusal: str | None = None
    tool_calls: list[_Call] | None = None
    """Of a tool that nobody offered: some models say a box so."""
    reasoning_content: str | None = None
    reasoning: str | None = None
    """The same, as vLLM calls it since 0.16."""

    @property
    def text(self) -> str:
        """What is said, or why nothing is; parts of another type, as `reasoning`, are no text."""
        said = self.content or self.refusal
        if not said:
            called = [call.function for call in self.tool_calls or () if call.function]
            said = "\n".join(str(function.arguments) for function in called)
        if isinstance(said, str):
            return said
        return "".join(part.text or "" for part in said if part.type in ("text", "output_text"))


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
        """Ask for one object (`the orange ball`) in a picture of the size that shall be seen.

        Nobody has looked for a box in the answer yet. EndpointError if nothing came back, and
        trying again at once will not help.
        """

    def close(self) -> None:
        """Close the connections."""


class OpenAIClient:
    """Asks an OpenAI-compatible endpoint, see `ModelClient`."""

    def __init__(self, config: VisionLanguageModelConfig) -> None:
        """Prepare the connection; nothing is sent yet.

        MissingExtraError if the extra [vlm] is not installed, ConfigurationError if the variable
        that should hold the key is not set.
        """
        check_installed("openai")
        import openai

        from prior_reinforce.perception.bounded_replies import BoundedClient

        self.config, self.model = config, config.model
        self._key = _NO_KEY  # the client insists on one; servers that want none take any
        if config.api_key_variable is not None:
            self._key = os.environ.get(config.api_key_variable, "")
            if not self._key:
                raise ConfigurationError(
                    f"environment variable {config.api_key_variable} is not set; export the key of "
                    f"{without_secrets(config.base_url)} in it"
                )
            if not (self._key.isascii() and self._key.isprintable() and " " not in self._key):
                raise ConfigurationError(
                    f"environment variable {config.api_key_variable} holds what no key does: a "
                    "blank, a line end, or a letter or dash of another alphabet; copy the key again"
                )
        # A proxy, set for the internet at large, does not know a server on this machine.
        self._proxied = urlsplit(config.base_url).hostname not in _THIS_MACHINE
        own = config.certificate
        try:
            http = BoundedClient(
                config.timeout,
                _MOST_BYTES + _BYTES_A_TOKEN * config.max_tokens,
                verify=ssl.create_default_context(cafile=own) if own else True,
                trust_env=self._proxied,
                # A redirection would send the picture, and maybe the key, somewhere else.
                follow_redirects=False,
            )
        except ssl.SSLError as error:
            raise ConfigurationError(
                f"certificate {own} is none ({error}); give a .pem file"
            ) from error
        except OSError as error:
            raise ConfigurationError(
                f"cannot read the certificate {own} ({error.strerror})"
            ) from error
        except (ImportError, ValueError) as error:
            raise ConfigurationError(
                f"{' or '.join(_proxies())} in the environment names a proxy that is not "
                f"understood ({error}); unset it, or for socks5: pip install 'httpx[socks]'"
            ) from error
        self._client = openai.OpenAI(
            base_url=config.base_url,
            api_key=self._key,
            timeout=config.timeout,
            max_retries=config.max_retries,
            http_client=http,
        )
        self._sent: tuple[object, str] = (None, "")

    def ask(self, words: str, picture: Picture) -> Answer:
        """See `ModelClient.ask`."""
        if self._sent[0] is not picture:  # the same picture is asked about several times
            self._sent = (picture, _png_address(picture))
        prompt = FORMATS[self.config.family].prompt.format(words=words)
        asked: list[Any] = [
            {"type": "image_url", "image_url": {"url": self._sent[1]}},
            {"type": "text", "text": prompt},
        ]
        more = {
            "temperature": self.config.temperature,
            "max_tokens": self.config.max_tokens,
            **_extra_body(self.config),
        }
        content = b""
        try:
            response = self._client.chat.completions.with_raw_response.create(
                model=self.config.model,
                messages=[{"role": "user", "content": asked}],
                extra_body={k: v for k, v in more.items() if k not in self.config.leave_out},
            )
            content = response.content.removeprefix(codecs.BOM_UTF8)
            choice = msgspec.json.decode(content, type=_Completion).choices[0]
        # Whatever a server sends, the client's parsing included, is no reason to break off.
        except Exception as error:
            raise EndpointError(self._what_failed(error, content)) from None
        message, reason = choice.message, choice.finish_reason
        thinking = message.reasoning_content or message.reasoning
        return Answer(
            self._hidden(message.text),
            None if thinking is None else self._hidden(thinking),
            None if reason is None else self._hidden(reason),
        )

    def close(self) -> None:
        """Close the connections."""
        self._client.close()

    def _hidden(self, text: str) -> str:
        """A text without the key and its parts, which a server may send back."""
        if self._key == _NO_KEY:
            return text
        n = min(len(self._key), _HIDDEN)
        parts = {self._key[at : at + n] for at in range(len(self._key) - n + 1)}
        shown, begin = "", 0
        for at in range(len(text)):
            if text[at : at + n] in parts:
                shown, begin = f"{shown}{text[begin:at]}***" if at >= begin else shown, at + n
        return shown + text[begin:]

    def _what_failed(self, error: Exception, content: bytes) -> str:
        """One line with the server's own words and the remedy, whatever way a request fails.

        The content is that of an answer with HTTP 200, which is no completion.
        """
        import openai

        config = self.config
        headers = getattr(getattr(error, "request", None), "headers", {})
        n_tries = 1 + int(headers.get("x-stainless-retry-count", config.max_retries))
        url = without_secrets(config.base_url)
        tries = "after one try" if n_tries == 1 else f"after {n_tries} tries"
        said, refused = self._words_of(error, content)
        if isinstance(error, openai.APITimeoutError):
            return f"no answer from {url} in {config.timeout:g} s {tries}; raise timeout"
        for each in (error, error.__cause__):  # which of them depends on the client's version
            if isinstance(each, EndpointError):
                return f"{url} sends {each}; raise max_tokens if it is meant to"
        if isinstance(error, openai.APIConnectionError):
            remedy = "is the server running? is the address right, http or https?"
            if "certificate is not valid for" in said:
                remedy = "set base_url to the name that the server's certificate is for"
            elif "CERTIFICATE" in said:
                remedy = "give the server's own certificate, a .pem file, as certificate"
            elif self._proxied and _proxies():
                remedy += f" {' or '.join(_proxies())} sets a proxy"
            return f"cannot reach {url} {tries} ({said}); {remedy}"
        if refused and content:
            return f"{url} refuses with HTTP 200: {said}; see to the account, or the server's log"
        if not isinstance(error, openai.APIStatusError):
            return (
                f"{url} answers, but not with a chat completion ({said}); the address of an "
                "OpenAI-compatible endpoint mostly ends in /v1"
            )
        what, remedy = f"failed with HTTP {error.status_code}", "see the server's log"
        wait = _wait(error.response.headers.get("Retry-After", ""))
        if error.status_code == 429:
            what = f"refuses more requests for now (HTTP 429) {tries}"
            remedy = f"wait {wait}, or see to the account's quota"
        elif error.status_code == 402:
            what = "wants to be paid (HTTP 402)"
            remedy = "top up the account's credit, or see the account's log"
        elif error.status_code == 503:
            what = f"is not ready (HTTP 503) {tries}"
            remedy = f"wait {wait}, until the model is loaded or fewer ask it"
        elif error.status_code == 400 and "context" in said.lower():
            remedy = "lower max_tokens or max_image_side, or serve the model with a longer context"
        elif error.status_code == 401 or (error.status_code == 400 and "api key" in said.lower()):
            what, remedy = f"refuses the key (HTTP {error.status_code})", "set api_key_variable"
        elif error.status_code == 403:
            what = "refuses the request (HTTP 403)"
            remedy = "see to what the key may do, and in which country"
        elif error.status_code == 413:
            what, remedy = "finds the picture too large (HTTP 413)", "lower max_image_side"
        elif error.status_code == 404:
            what = f"does not serve model '{config.model}' (HTTP 404)"
            remedy = "set base_url and model"
        elif error.status_code == 407 and self._proxied:
            what = "is behind a proxy that wants a password (HTTP 407)"
            remedy = f"give it in {' or '.join(_proxies())}, as http://NAME:PASSWORD@proxy:3128"
        elif to := self._hidden(_redirected(error.response.headers.get("Location", ""), url)):
            what = f"sends the request on to {to} (HTTP {error.status_code})"
            base, path, _ = to.partition("/chat/completions")
            if not path:
                remedy = (
                    "that is no endpoint: set api_key_variable, or base_url to the API's address"
                )
            elif base != url.rstrip("/"):
                remedy = f"set base_url to {base}"
        elif fields := [field for field in get_args(_Field) if field in said]:
            remedy = f"where a field is not supported, set leave_out = {fields}"
        return f"{url} {what}: {said}; {remedy}"

    def _words_of(self, error: Exception, content: bytes) -> tuple[str, bool]:
        """What the server, or the network, says of a failure; whether the server names an error."""
        body, response = getattr(error, "body", None), getattr(error, "response", None)
        words: object = content.decode(errors="replace") or error.__cause__ or error
        with suppress(ValueError, RecursionError):
            body = msgspec.json.decode(content) if content else body
        body = body[0] if isinstance(body, list) and body else body  # as Gemini wraps its errors
        named = body.get("error") or body if isinstance(body, dict) else body
        if isinstance(named, dict):
            named = named.get("message") or named.get("detail")
            named = None if isinstance(named, dict) else named  # a message of a chat is no error
        if isinstance(body, dict):
            words = named or words
        elif response is not None:
            words = response.text or words
        # The key is hidden before anything is cut: the rest of it would be no longer found.
        said = " ".join(self._hidden(str(words) or type(words).__name__).split())
        if len(said) > _MOST_SHOWN:  # not within a number
            said = f"{said[:_MOST_SHOWN].rpartition(' ')[0] or said[:_MOST_SHOWN]} ..."
        return said, isinstance(body, dict) and bool(named)


def _redirected(location: str, url: str) -> str:
    """Where a redirection of a request to an endpoint leads; empty where that is no address."""
    with suppress(ValueError, ConfigurationError):
        to = without_secrets(urljoin(f"{url.rstrip('/')}/chat/completions", location))
        return to[:_MOST_SHOWN] if location else ""
    return ""


def _wait(asked: str) -> str:
    """How long a server asks to wait, in seconds or by a date; a minute if it asks for nothing."""
    with suppress(ValueError, OverflowError):
        return f"{max(1, math.ceil(float(asked)))} s, as it asks"
    with suppress(ValueError):
        return f"until {parsedate_to_datetime(asked):%d %B %H:%M %Z}, as it asks"
    return "a minute"


def _proxies() -> list[str]:
    """Variables of the environment that set a proxy."""
    return [name for name in os.environ if name.lower() in _PROXIES and os.environ[name]]


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

    ConfigurationError, which does not show it, if it is no address.
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
