"""Work on a Ray cluster that survives the loss of a node.

joblib's Ray backend does not: a lost actor takes its work with it and fails whatever it is given
next. Plain Ray tasks are put on another node by Ray itself.
"""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

from prior_reinforce.errors import ConfigurationError, MissingExtraError

Item = TypeVar("Item")
Result = TypeVar("Result")

_RETRIES = 4
"""Lost nodes or workers that one piece of work survives; a unit that crashes them all by itself
must come to an end."""
_ANSWER_S = 5.0
"""How long an address may take to answer, in [s]; Ray itself would try for minutes."""


def run_on_ray(
    work: Callable[[Item], Result],
    items: Sequence[Item],
    address: str,
    *,
    lost: Callable[[Item, Exception], Result],
) -> Iterator[Result]:
    """Work on every item, a core each, and yield results as they come.

    Args:
        work: What to do; importable on every node, and harmless to do twice.
        items: What to do it to.
        address: Of the cluster: `auto`, `host:port` or `ray://host:port`.
        lost: What to yield for an item whose workers died too often, and what Ray says of it.

    Yields:
        Results, in the order in which they are ready.

    Raises:
        MissingExtraError: Ray is not installed.
        ConfigurationError: No cluster answers at the address.
    """
    _check_answers(address)
    try:
        import ray
    except ImportError as error:
        raise MissingExtraError(
            "a Ray cluster needs Ray; install it with: pip install ray"
        ) from error
    if not ray.is_initialized():
        try:
            ray.init(address=address, log_to_driver=False)
        except (ConnectionError, ValueError, RuntimeError) as error:
            raise _no_cluster(address, error) from error
    remote: Any = ray.remote(num_cpus=1, max_retries=_RETRIES)(lambda item: work(item))
    waiting = {remote.remote(item): item for item in items}
    try:
        while waiting:
            (ready,), _ = ray.wait(list(waiting))
            item = waiting.pop(ready)
            try:
                result = ray.get(ready)
            except ray.exceptions.RayError as error:
                result = lost(item, error)
            yield result
    finally:
        for left in waiting:
            ray.cancel(left)


def _check_answers(address: str) -> None:
    """Raise unless something listens at `host:port`; `auto` is left to Ray."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if host and port.isdecimal():
        try:
            socket.create_connection((host, int(port)), timeout=_ANSWER_S).close()
        except (OSError, OverflowError) as error:
            raise _no_cluster(address, error) from error


def _no_cluster(address: str, error: Exception) -> ConfigurationError:
    reason = str(error).partition("\n")[0]
    return ConfigurationError(
        f"no Ray cluster answers at {address}: {reason}; start one with: ray start --head, and let "
        "this program show its token: export RAY_AUTH_MODE=token"
    )
