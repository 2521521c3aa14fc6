"""The console's interface over HTTP: a table of endpoints, and what it says of itself (OpenAPI).

Everything is bounded: sizes, the time that a client may take, the number of tabs. An error is one
sentence, for the person at the page.
"""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial
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
from uvicorn.protocols.http.h11_impl import H11Protocol

from prior_reinforce.bench.console.camera import LARGEST_PICTURE, Pictures
from prior_reinforce.bench.console.guard import Guard, report_path
from prior_reinforce.bench.console.imports import LARGEST_FILE, Imports
from prior_reinforce.bench.console.verbs import Verbs
from prior_reinforce.errors import PriorReinforceError, TrialStateError, WorkspaceError
from prior_reinforce.extras import missing_extra
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig

_LARGEST_BODY = 100_000
"""Bytes of a request, but for files; ours: hundreds of times what any verb takes."""
_LONGEST_WAIT = 10.0
"""For the next piece of a request, in [s]; ours: a slow telephone sends many a second."""
_MOST_TABS = 50
_QUEUE = 200
"""Messages that a tab may lag behind before it is told to ask again."""
_BEAT = 5.0
"""Between signs of life, in [s], by which a page knows that what it shows is of now."""
_STATUSES = {
    400: "Not what the interface expects; the message says what is wrong.",
    401: "Without the secret of the link.",
    403: "From another site, or for another computer.",
    404: "There is no such thing.",
    405: "Another method.",
    408: "The request took too long.",
    409: "Not done: the workspace has gone on, or cannot do that now.",
    413: "Too large.",
    422: "Not done: what was given cannot be used.",
    429: "Too many tabs.",
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

    @property
    def takes(self) -> dict[str, Any]:
        """Type of each argument."""
        hints = get_type_hints(self.call)
        return {name: kind for name, kind in hints.items() if name != "return"}

    @property
    def body(self) -> Any:
        """Type of the body; None where there is none."""
        return next((kind for kind in self.takes.values() if kind not in (int, str)), None)

    @property
    def answers(self) -> Any:
        """Type of the answer."""
        return get_type_hints(self.call)["return"]


_STOP, _RECORDINGS = "/api/stop", "/api/recordings"
_PLAN = "/api/plans/{number:int}"
_PARAMETERS = {
    int: {"type": "integer", "minimum": 0, "maximum": 2**31},
    str: {"type": "string", "minLength": 1, "maxLength": 600},
}


def endpoints(verbs: Verbs, imports: Imports, pictures: Pictures) -> list[Endpoint]:
    """Everything that can be asked, but for the stream of events."""
    return [
        Endpoint("GET", "/api/state", verbs.state),
        Endpoint("POST", "/api/goal", verbs.set_goal),
        Endpoint("POST", "/api/ask", verbs.ask),
        Endpoint("POST", "/api/execute", verbs.execute),
        Endpoint("POST", _STOP, verbs.stop),
        Endpoint("POST", "/api/tell", verbs.tell),
        Endpoint("POST", "/api/amend", verbs.amend),
        Endpoint("POST", "/api/void", verbs.void),
        Endpoint("POST", "/api/learn", verbs.learn),
        Endpoint("GET", _PLAN, verbs.motion),
        Endpoint("GET", f"{_PLAN}/file", verbs.plan_file),
        Endpoint("GET", _RECORDINGS, imports.look),
        Endpoint("PUT", _RECORDINGS, imports.drop, LARGEST_FILE),
        Endpoint("DELETE", _RECORDINGS, imports.discard),
        Endpoint("POST", "/api/outcome", imports.place),
        Endpoint("POST", "/api/import", imports.take),
        Endpoint("GET", "/api/camera", pictures.look_up),
        Endpoint("GET", "/api/picture", pictures.file, media="image/jpeg"),
        Endpoint("PUT", "/api/picture", pictures.keep, LARGEST_PICTURE),
        Endpoint("POST", "/api/calibrate", pictures.calibrate),
        Endpoint("GET", "/api/tags", pictures.tags),
        Endpoint("GET", "/api/tags/sheet", pictures.sheet, media="image/png"),
        Endpoint("POST", "/api/find", pictures.find),
    ]


def application(
    verbs: Verbs,
    events: Events,
    token: str,
    host: str,
    vlm: VisionLanguageModelConfig,
) -> Guard:
    """Make the console, an ASGI application.

    Args:
        verbs: The workspace.
        events: What `verbs` publishes to.
        token: The secret.
        host: Name or address that it is to listen at.
        vlm: Which model finds objects in pictures.
    """
    table = endpoints(verbs, Imports(verbs), Pictures(verbs, vlm))
    page = resources.files(__package__)

    def static(name: str, kind: str) -> Route:
        content = page.joinpath(name).read_bytes()
        path = "/" if name == "page.html" else f"/{name}"
        return Route(path, lambda _: Response(content, media_type=kind), methods=["GET"])

    async def report(request: Request) -> Response:
        if request.url.path != report_path(token):
            raise HTTPException(404)
        return FileResponse(await anyio.to_thread.run_sync(verbs.write_report))

    schema = openapi(table)
    routes = [
        static("page.html", "text/html"),
        static("console.js", "text/javascript"),
        static("console.css", "text/css"),
        static("icon.svg", "image/svg+xml"),
        Route("/report/{ticket}", _told(report)),
        Route("/api/events", events.stream),
        Route("/api/openapi.json", lambda _: _json(schema)),
        *(Route(e.path, _told(partial(_answer, e)), methods=[e.method]) for e in table),
    ]

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        events.begin()
        yield
        await anyio.to_thread.run_sync(verbs.close)

    handlers = {HTTPException: lambda _, error: _problem(error.status_code, str(error.detail))}
    return Guard(
        Starlette(routes=routes, lifespan=lifespan, exception_handlers=handlers), token, host
    )


async def _answer(endpoint: Endpoint, request: Request) -> Response:
    said, given = {**request.query_params, **request.path_params}, {}
    for name, kind in endpoint.takes.items():
        if kind in _PARAMETERS:
            if name not in said:
                raise HTTPException(400, f"say {name}")
            given[name] = said[name]
        else:
            content = await _read(request, endpoint.largest)
            given[name] = content if kind is bytes else msgspec.json.decode(content, type=kind)
    threads = _FOR_STOP if endpoint.path == _STOP else None
    answer = await anyio.to_thread.run_sync(partial(endpoint.call, **given), limiter=threads)
    if isinstance(answer, Path):
        return FileResponse(answer, media_type=endpoint.media)
    return _json(answer)


async def _read(request: Request, largest: int) -> bytes:
    """A request's body, if it is small enough and comes in time."""
    said = request.headers.get("content-length", "0")
    if not said.isdecimal() or len(said) > 12 or int(said) > largest:
        raise HTTPException(413, f"at most {largest / 1e6:g} MB are taken")
    content = bytearray()
    stream = request.stream()
    try:
        while True:
            with anyio.fail_after(_LONGEST_WAIT):
                content += await anext(stream)
            if len(content) > largest:
                raise HTTPException(413, f"at most {largest / 1e6:g} MB are taken")
    except StopAsyncIteration:
        return bytes(content)
    except TimeoutError:
        raise HTTPException(408, "the request took too long; send it again") from None


def _told(answer: Callable[[Request], Any]) -> Callable[[Request], Any]:
    """Answer, or say in one sentence why not."""

    async def told(request: Request) -> Response:
        try:
            return await answer(request)
        except (TrialStateError, WorkspaceError) as error:
            return _problem(409, str(error))
        except PriorReinforceError as error:
            return _problem(422, str(error))
        except ImportError as error:
            missing = missing_extra(error)
            if missing is None:
                raise
            return _problem(422, str(missing))
        except (msgspec.DecodeError, msgspec.ValidationError, UnicodeDecodeError) as error:
            return _problem(400, f"{error}")
        except ClientDisconnect:
            return _problem(400, "the client left")

    return told


def _json(answer: Any, status: int = 200) -> Response:
    return Response(msgspec.json.encode(answer), status, media_type="application/json")


def _problem(status: int, error: str) -> Response:
    return _json(Problem(error), status)


class Events:
    """What happens, told to every tab as server-sent events."""

    def __init__(self) -> None:
        """Nobody listens yet."""
        self._loop: asyncio.AbstractEventLoop | None = None
        self._tabs: set[asyncio.Queue[bytes]] = set()

    def begin(self) -> None:
        """Publish from now on, on the running loop."""
        self._loop = asyncio.get_running_loop()

    def publish(self, message: dict[str, Any]) -> None:
        """Tell all tabs; called in any thread."""
        text = b"data: " + msgspec.json.encode(message) + b"\n\n"
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._put, text)

    def _put(self, text: bytes) -> None:
        for tab in self._tabs:
            if not tab.full():  # one that lags so far behind hears of the state with the next beat
                tab.put_nowait(text)

    async def stream(self, request: Request) -> Response:
        """Send them until the tab is closed."""
        if len(self._tabs) >= _MOST_TABS:
            return _problem(429, f"{_MOST_TABS} tabs are open; close some")
        return StreamingResponse(self._lines(), media_type="text/event-stream")

    async def _lines(self) -> AsyncIterator[bytes]:
        tab: asyncio.Queue[bytes] = asyncio.Queue(_QUEUE)
        self._tabs.add(tab)
        try:
            yield b"data: {}\n\n"
            while True:
                try:
                    yield await asyncio.wait_for(tab.get(), _BEAT)
                except (TimeoutError, asyncio.TimeoutError):
                    yield b"data: {}\n\n"
        finally:
            self._tabs.discard(tab)


def openapi(table: list[Endpoint]) -> dict[str, Any]:
    """What the interface says of itself, OpenAPI 3.1."""
    kinds = dict.fromkeys(kind for e in table for kind in (e.body, e.answers))
    types = [Problem, *(kind for kind in kinds if kind not in (None, bytes, Path))]
    shapes, components = msgspec.json.schema_components(
        types, ref_template="#/components/schemas/{name}"
    )
    shape = dict(zip(types, shapes, strict=True))

    def content(kind: Any, media: str = "application/octet-stream") -> dict[str, Any]:
        if kind in shape:
            return {"application/json": {"schema": shape[kind]}}
        return {media: {"schema": {"type": "string", "format": "binary"}}}

    problems = {
        str(status): {"description": said, "content": content(Problem)}
        for status, said in _STATUSES.items()
    }
    paths: dict[str, Any] = {}
    for e in table:
        path = e.path.replace(":int}", "}")
        done = {"description": "Done.", "content": content(e.answers, e.media)}
        operation: dict[str, Any] = {
            "summary": (e.call.__doc__ or "").partition("\n")[0],
            "operationId": e.call.__name__,
            "responses": {"200": done, **problems},
            "parameters": [
                {"name": name, "in": "path" if f"{{{name}}}" in path else "query", "required": True}
                | {"schema": _PARAMETERS[kind]}
                for name, kind in e.takes.items()
                if kind in _PARAMETERS
            ],
        }
        if e.body is not None:
            operation["requestBody"] = {"required": True, "content": content(e.body)}
        paths.setdefault(path, {})[e.method.lower()] = operation
    return {
        "openapi": "3.1.0",
        "info": {"title": "prior-reinforce console", "version": "1"},
        "security": [{"link": []}],
        "paths": paths,
        "components": {
            "schemas": components,
            "securitySchemes": {"link": {"type": "http", "scheme": "bearer"}},
        },
    }


class _Impatient(H11Protocol):
    """Closes a connection on which no request comes, or only the beginning of one."""

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        self.loop.call_later(_LONGEST_WAIT, self._close_if_idle)

    def _close_if_idle(self) -> None:
        if self.cycle is None:
            self.transport.close()


def serve(app: Guard, listening: socket.socket) -> None:
    """Answer at a socket until the program is interrupted."""
    config = uvicorn.Config(
        app,
        http=_Impatient,
        ws="none",
        log_level="warning",
        access_log=False,
        server_header=False,
        timeout_keep_alive=30,
        timeout_graceful_shutdown=1,
        h11_max_incomplete_event_size=16_384,
    )
    server = uvicorn.Server(config)
    assert threading.current_thread() is threading.main_thread()
    server.run([listening])
