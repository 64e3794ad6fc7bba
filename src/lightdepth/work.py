"""How far long work is, for whoever watches it: the work itself does not know who does."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_watch: ContextVar[Callable[[float], None] | None] = ContextVar("watch", default=None)
_portion: ContextVar[list[float] | None] = ContextVar("portion", default=None)


@contextmanager
def watched(report: Callable[[float], None]) -> Iterator[None]:
    """Within, long work of this thread tells ``report`` which share of it is done, from 0 to 1."""
    token = _watch.set(report)
    try:
        yield
    finally:
        _watch.reset(token)


@contextmanager
def work(total: float) -> Iterator[None]:
    """Within, :func:`advance` counts toward ``total``, in any unit; it may turn out to be less."""
    token = _portion.set([0.0, total])
    try:
        yield
    finally:
        _portion.reset(token)


def advance(done: float) -> None:
    """To be called between portions of long work: how much the last one was."""
    report, portion = _watch.get(), _portion.get()
    if report is not None and portion is not None:
        portion[0] += done
        report(min(portion[0] / portion[1], 1.0))
