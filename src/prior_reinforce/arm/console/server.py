"""The console's interface over HTTP: a table of endpoints, and what it says of itself (OpenAPI).

Everything is bounded: sizes, the time that a client may take, the number of tabs. An error is one
sentence, for the person at the page.
"""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial
from http import HTTPStatus
from importlib import resources
from pathlib import Path
from typing import Any, get_type_hints

import anyio
import msgspec
import uvicorn
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from prior_reinforce.arm.console.camera import LARGEST_PICTURE, Pictures
from prior_reinforce.arm.console.guard import PUBLIC, Guard, problem, report_path
from prior_reinforce.arm.console.imports import LARGEST_FILE, Imports
from prior_reinforce.arm.console.verbs import Verbs
from prior_reinforce.errors import PriorReinforceError, TrialStateError, WorkspaceError
from prior_reinforce.extras import missing_extra
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig
from prior_reinforce.report.html import MIME_TYPES

_LARGEST_BODY = 100_000
"""Bytes of a request, but for files; ours: hundreds of times what any verb takes."""
_LONGEST_WAIT = 10.0
"""For the next piece of a request, in [s]; ours: a slow telephone sends many a second."""
_MOST_TABS = 50
_QUEUE = 200
"""Messages that a tab may lag behind before it is told to ask again."""
_BEAT = 5.0
"""Between signs of life, in [s], by which a page knows that what it shows is of now."""
_ALIVE = b"data: {}\n\n"
_STATUS_OF: dict[type[Exception], int] = {
    TrialStateError: 409,
    WorkspaceError: 409,
    PriorReinforceError: 422,
    msgspec.MsgspecError: 400,
    UnicodeDecodeError: 400,
    ClientDisconnect: 400,
    OSError: 409,
}
_FOR_STOP = anyio.CapacityLimiter(8)
"""Threads that only stop the arm: whatever else is asked at the same time, some are free."""

Problem = msgspec.defstruct("Problem", [("error", str)])


@dataclass(frozen=True)
class Endpoint:
    """One thing that can be asked of the console; what it takes and gives is in its annotations.

    A struct or bytes is the request's body, anything else stands in the path or the query. A path
    that is returned is a file to be sent.
    """

    method: str
    path: str
    call: Callable[..., Any]
    """In a thread of its own."""
    largest: int = _LARGEST_BODY
    media: str = "application/octet-stream"
    """Of a file that is sent."""


_STOP, _RECORDINGS = "/api/stop", "/api/recordings"
_PLAN = "/api/plans/{number:int}"
_NUMBER = {"type": "integer", "minimum": 0, "maximum": 2**31}
_OPTIONAL = int | None
_PARAMETERS: dict[Any, dict[str, Any]] = {
    int: _NUMBER,
    _OPTIONAL: _NUMBER,
    str: {"type": "string", "minLength": 1, "maxLength": 600},
}


def endpoints(verbs: Verbs, imports: Imports, pictures: Pictures) -> list[Endpoint]:
    """Everything that can be asked, but for the stream of events."""
    posted: list[Callable[..., Any]] = [
        *(verbs.goal, verbs.ask, verbs.question, verbs.execute, verbs.stop, verbs.tell),
        *(verbs.amend, verbs.void, verbs.learn, imports.place, imports.take),
        *(imports.columns, pictures.calibrate, pictures.find),
    ]
    return [
        *(Endpoint("POST", f"/api/{call.__name__}", call) for call in posted),
        Endpoint("GET", "/api/state", verbs.state),
        Endpoint("GET", "/api/reach", verbs.reach),
        Endpoint("GET", _PLAN, verbs.motion),
        Endpoint("GET", f"{_PLAN}/file", verbs.plan_file),
        Endpoint("GET", _RECORDINGS, imports.look),
        Endpoint("PUT", _RECORDINGS, imports.drop, LARGEST_FILE),
        Endpoint("DELETE", _RECORDINGS, imports.discard),
        Endpoint("GET", "/api/camera", pictures.look_up),
        Endpoint("GET", "/api/picture", pictures.file, media="image/jpeg"),
        Endpoint("PUT", "/api/picture", pictures.keep, LARGEST_PICTURE),
        Endpoint("GET", "/api/tags", pictures.tags),
    ]


def application(
    verbs: Verbs, events: Events, token: str, host: str, vlm: VisionLanguageModelConfig
) -> Guard:
    """Make the console, an ASGI application that is to listen at `host`, for who has the token."""
    table = endpoints(verbs, Imports(verbs), Pictures(verbs, vlm))
    schema = openapi(table)

    def static(path: str, kind: str) -> Route:
        name = path.removeprefix("/") or "page.html"
        content = resources.files(__package__).joinpath(name).read_bytes()
        return Route(path, lambda _: Response(content, media_type=kind))

    async def report(request: Request) -> Response:
        name = request.path_params["name"]
        if request.scope["path"] != report_path(token, name):
            raise HTTPException(404)
        if name == "report.html":
            return FileResponse(await anyio.to_thread.run_sync(verbs.write_report))
        beside = verbs.folder / "report" / name
        if beside.suffix not in MIME_TYPES or not beside.is_file() or beside.is_symlink():
            raise HTTPException(404)
        return FileResponse(beside, media_type=MIME_TYPES[beside.suffix])

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        events.loop = asyncio.get_running_loop()
        yield
        await anyio.to_thread.run_sync(verbs.close)

    routes = [
        *(static(path, kind) for path, kind in PUBLIC.items()),
        Route("/report/{ticket}/{name}", report),
        Route("/api/events", events, methods=["GET"]),
        Route("/api/openapi.json", lambda _: _json(schema)),
        *(Route(e.path, partial(_answer, e), methods=[e.method]) for e in table),
    ]
    handlers = dict.fromkeys((HTTPException, ImportError, *_STATUS_OF), _refuse)
    app = Starlette(routes=routes, lifespan=lifespan, exception_handlers=handlers)
    return Guard(app, token, host)


async def _answer(endpoint: Endpoint, request: Request) -> Response:
    said, given = {**request.query_params, **request.path_params}, {}
    for name, kind in get_type_hints(endpoint.call).items():
        if kind in _PARAMETERS:
            if name in said:
                given[name] = msgspec.convert(said[name], kind, strict=False)
            elif kind != _OPTIONAL:
                raise HTTPException(400, f"say {name}")
        elif name != "return":
            content = await _read(request, endpoint.largest)
            given[name] = content if kind is bytes else msgspec.json.decode(content, type=kind)
    threads = _FOR_STOP if endpoint.path == _STOP else None
    answer = await anyio.to_thread.run_sync(partial(endpoint.call, **given), limiter=threads)
    is_file = isinstance(answer, Path)
    return FileResponse(answer, media_type=endpoint.media) if is_file else _json(answer)


async def _read(request: Request, largest: int) -> bytes:
    """A request's body, if it is small enough and comes in time."""
    said = request.headers.get("content-length", "0")
    too_large = HTTPException(413, f"at most {largest / 1e6:g} MB are taken")
    if not said.isdecimal() or len(said) > 12 or int(said) > largest:
        raise too_large
    content = bytearray()
    stream = request.stream()
    try:
        while True:
            with anyio.fail_after(_LONGEST_WAIT):
                content += await anext(stream)
            if len(content) > largest:
                raise too_large
    except StopAsyncIteration:
        return bytes(content)
    except TimeoutError:
        raise HTTPException(408, "the request took too long; send it again") from None


def _refuse(_: Request, error: Exception) -> Response:
    """Say in one sentence why not."""
    if isinstance(error, HTTPException):
        return problem(error.status_code, error.detail)
    if isinstance(error, ImportError):
        error = missing_extra(error) or error
    if isinstance(error, OSError):  # a disk that is full, or a file that vanished meanwhile
        named = f"{error.filename}: " if error.filename is not None else ""
        return problem(409, f"{named}{error.strerror or error}; look at the folder, then try again")
    for kind in type(error).__mro__:
        if kind in _STATUS_OF:
            return problem(_STATUS_OF[kind], str(error))
    raise error


def _json(answer: Any) -> Response:
    return Response(msgspec.json.encode(answer), media_type="application/json")


class Events:
    """What happens, told to every tab as server-sent events."""

    def __init__(self) -> None:
        """Nobody listens yet."""
        self.loop: asyncio.AbstractEventLoop | None = None
        """On which it publishes; nothing is published before."""
        self._tabs: set[asyncio.Queue[bytes]] = set()
        self._ended = False

    def publish(self, message: dict[str, Any]) -> None:
        """Tell all tabs; called in any thread."""
        text = b"data: " + msgspec.json.encode(message) + b"\n\n"
        if self.loop is not None and not self.loop.is_closed():
            self.loop.call_soon_threadsafe(self._put, text)

    def _put(self, text: bytes) -> None:
        for tab in self._tabs:
            if not tab.full():  # one that lags so far behind hears of the state with the next beat
                tab.put_nowait(text)

    def end(self) -> None:
        """Let go of all tabs, and take no more; called on the loop."""
        self._ended = True
        for tab in self._tabs:
            while not tab.empty():
                tab.get_nowait()
            tab.put_nowait(b"")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send them until the tab is closed, or the console is; an ASGI application."""
        if self._ended or len(self._tabs) >= _MOST_TABS:
            await problem(429, f"{_MOST_TABS} tabs are open; close some")(scope, receive, send)
            return
        tab: asyncio.Queue[bytes] = asyncio.Queue(_QUEUE)
        self._tabs.add(
            tab
        )  # as it is counted: tabs that come in one burst wait for nothing between
        try:
            stream = StreamingResponse(self._lines(tab), media_type="text/event-stream")
            await stream(scope, receive, send)
        finally:
            self._tabs.discard(tab)

    async def _lines(self, tab: asyncio.Queue[bytes]) -> AsyncIterator[bytes]:
        text = _ALIVE
        while text:
            yield text
            try:
                text = await asyncio.wait_for(tab.get(), _BEAT)
            except (TimeoutError, asyncio.TimeoutError):
                text = _ALIVE


def openapi(table: list[Endpoint]) -> dict[str, Any]:
    """What the interface says of itself, OpenAPI 3.1."""
    kinds = dict.fromkeys(kind for e in table for kind in get_type_hints(e.call).values())
    types = [Problem, *(kind for kind in kinds if kind not in (bytes, Path, *_PARAMETERS))]
    shapes, components = msgspec.json.schema_components(
        types, ref_template="#/components/schemas/{name}"
    )
    shape = dict(zip(types, shapes, strict=True))

    def content(kind: Any, media: str = "application/octet-stream") -> dict[str, Any]:
        if kind in shape:
            return {"application/json": {"schema": shape[kind]}}
        return {media: {"schema": {"type": "string", "format": "binary"}}}

    refusals = {
        str(status): {"description": HTTPStatus(status).phrase, "content": content(Problem)}
        for status in (400, 401, 403, 404, 405, 408, 409, 413, 422, 429)
    }
    paths: dict[str, Any] = {}
    for e in table:
        takes, path = get_type_hints(e.call), e.path.replace(":int}", "}")
        done = {"description": "Done.", "content": content(takes.pop("return"), e.media)}
        operation = paths.setdefault(path, {})[e.method.lower()] = {
            "summary": (e.call.__doc__ or "").partition("\n")[0],
            "operationId": e.call.__name__,
            "responses": {"200": done, **refusals},
            "parameters": [
                {"name": name, "in": "path" if f"{{{name}}}" in path else "query"}
                | {"required": kind != _OPTIONAL, "schema": _PARAMETERS[kind]}
                for name, kind in takes.items()
                if kind in _PARAMETERS
            ],
        }
        for kind in takes.values():
            if kind not in _PARAMETERS:
                operation["requestBody"] = {"required": True, "content": content(kind)}
    schemes = {"link": {"type": "http", "scheme": "bearer"}}
    return {
        "openapi": "3.1.0",
        "info": {"title": "prior-reinforce console", "version": "1"},
        "security": [{"link": []}],
        "paths": paths,
        "components": {"schemas": components, "securitySchemes": schemes},
    }


class _Impatient(H11Protocol):
    """Closes a connection on which no request comes, or only the beginning of one."""

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        self.loop.call_later(_LONGEST_WAIT, lambda: self.cycle or transport.close())


class _Server(uvicorn.Server):
    """Lets go of open pages first when it ends, rather than wait for them and cut them off."""

    def __init__(self, config: uvicorn.Config, events: Events) -> None:
        super().__init__(config)
        self._events = events

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._events.end()
        # What is asked at this moment is cut off, which is no error to be logged.
        logging.getLogger("uvicorn.error").setLevel(logging.CRITICAL)
        await super().shutdown(sockets)


def server_of(
    app: Guard, events: Events, certificate: Path | None = None, key: Path | None = None
) -> uvicorn.Server:
    """What answers at sockets until the program is interrupted, by https with a certificate."""
    config = uvicorn.Config(
        app,
        http=_Impatient,
        ws="none",
        log_level="warning",
        access_log=False,
        server_header=False,
        proxy_headers=False,
        timeout_keep_alive=30,
        timeout_graceful_shutdown=1,
        h11_max_incomplete_event_size=16_384,
        ssl_certfile=certificate,
        ssl_keyfile=key,
    )
    return _Server(config, events)
