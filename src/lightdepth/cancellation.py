"""Giving up long work in between: what takes long asks now and then whether it is still wanted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_wanted: ContextVar[Callable[[], bool] | None] = ContextVar("cancelled", default=None)


class Cancelled(Exception):  # noqa: N818 - no error: somebody wanted it
    """The work was given up because it is no longer wanted."""


@contextmanager
def cancellable(cancelled: Callable[[], bool]) -> Iterator[None]:
    """Within, long work of this thread ends with :class:`Cancelled` soon after ``cancelled`` returns true."""
    token = _wanted.set(cancelled)
    try:
        yield
    finally:
        _wanted.reset(token)


def raise_if_cancelled() -> None:
    """To be called between portions of long work.

    Raises:
        Cancelled: the work is no longer wanted.
    """
    cancelled = _wanted.get()
    if cancelled is not None and cancelled():
        raise Cancelled
