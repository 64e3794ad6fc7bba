"""`lightdepth cache`: what is kept on disk of places that were prepared."""

from __future__ import annotations

import time
from typing import Annotated

import typer
from rich.console import Console


def cache(
    clear: Annotated[bool, typer.Option("--clear", help="Remove all entries.")] = False,
) -> None:
    """List the prepared places that are kept on disk, or remove them.

    Rendering recovers the albedo and the light of a photographed place once and keeps them; the least recently used
    go first when they take more than a GiB. LIGHTDEPTH_CACHE names another folder, or is `off`.

    Example: lightdepth cache --clear
    """
    from lightdepth.store import OFF, VARIABLE, default_store

    console = Console(highlight=False, soft_wrap=True)
    store = default_store()
    if store is None:
        console.print(f"no cache: {VARIABLE} is '{OFF}', or there is no home folder", markup=False)
        return
    if clear:
        count = store.clear()
        console.print(f"removed {count} {_places(count)} from {store.folder}", markup=False)
        return
    entries = store.entries()
    for entry in entries:
        used = time.strftime("%Y-%m-%d %H:%M", time.localtime(entry.used))
        source = entry.source or "damaged"
        console.print(f"{used}  {entry.size / 2**20:8.1f} MiB  {source}", markup=False)
    total = sum(entry.size for entry in entries)
    console.print(
        f"{len(entries)} {_places(len(entries))}, {total / 2**20:.1f} of at most {store.limit / 2**20:.0f} MiB, "
        f"in {store.folder}",
        markup=False,
    )


def _places(count: int) -> str:
    return "prepared place" if count == 1 else "prepared places"
