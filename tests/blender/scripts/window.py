"""A real window for the package ``bpy``: imported before anything else of Blender.

The package is a whole Blender with its user interface, but at its start it sets the flag that ``blender --background``
sets, by one instruction in front of everything that looks at the flag. :func:`open_window` clears it in that
instruction, in memory; the file stays as it is. What then opens is Blender as it ships. Python has no function for its
event loop, so :func:`run` calls that by its symbol.
"""

import ctypes
import importlib.util
import mmap
import os
import re
import struct
import subprocess
import sys
import time
import traceback

import numpy as np

_SYMBOL = re.compile(
    r"([0-9a-f]+) \w (?:blender::)?(PyInit_bpy|main_python_enter|WM_main|BPY_context_get)\b(?!.*\.cold)"
)
_SET_FLAG = re.compile(rb"\xc6[\x80-\x87]..\x00\x00\x01", re.DOTALL)
"""``movb $1, offset(register)`` with an offset below 64 KiB: first for factory settings, then for the background."""
_PROLOGUE = 1500
"""Bytes of the function that starts Blender in which both flags are set."""
_WRITABLE = mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC
_addresses: dict[str, int] = {}


def open_window():
    """Start Blender with its window on the display that DISPLAY names; returns the module ``bpy``."""
    path = importlib.util.find_spec("bpy").origin
    listed = subprocess.run(["nm", "--defined-only", "--demangle", path], capture_output=True, text=True, check=True)
    symbols = {found[2]: int(found[1], 16) for found in map(_SYMBOL.match, listed.stdout.splitlines()) if found}
    library = ctypes.CDLL(path)
    base = ctypes.cast(library.PyInit_bpy, ctypes.c_void_p).value - symbols["PyInit_bpy"]
    _addresses.update({name: base + offset for name, offset in symbols.items()})
    start = _addresses["main_python_enter"]
    _, background, *_ = _SET_FLAG.finditer(ctypes.string_at(start, _PROLOGUE))
    value = start + background.end() - 1
    page = value - value % mmap.PAGESIZE
    if ctypes.CDLL(None).mprotect(ctypes.c_void_p(page), mmap.PAGESIZE, _WRITABLE) != 0:
        raise OSError("the instruction cannot be changed")
    ctypes.c_char.from_address(value).value = b"\0"
    import bpy

    assert not bpy.app.background
    return bpy


def run(steps):
    """Let Blender live, and do something in it from time to time; never returns.

    Args:
        steps: a generator that is resumed when as many seconds as it yielded have passed. Blender ends with it.
    """
    import bpy

    def step():
        try:
            return next(steps)
        except StopIteration:
            status = 0
        except BaseException:
            traceback.print_exc()
            status = 1
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)  # Blender would ask whether to save

    bpy.app.timers.register(step)
    context = ctypes.CFUNCTYPE(ctypes.c_void_p)(_addresses["BPY_context_get"])
    loop = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(_addresses["WM_main"])
    loop(context())


def until(condition, seconds=200.0, every=0.01):
    """Let Blender live until something is so; ask every so many seconds."""
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            line = f"{condition.__code__.co_filename}:{condition.__code__.co_firstlineno}"
            raise TimeoutError(f"waited {seconds:g} seconds for what {line} says")
        yield every


def drawn():
    """Let Blender draw what has changed: its loop comes round twice."""
    yield 0.0
    yield 0.0


def tools():
    """The operators that wait for events in the first window."""
    import bpy

    return [each for each in bpy.context.window_manager.windows[0].modal_operators if hasattr(each, "modal")]


def editor(kind):
    """The largest editor on the first window's screen, changed to a kind: ``temp_override``'s arguments for it."""
    import bpy

    window = bpy.context.window_manager.windows[0]
    area = max(window.screen.areas, key=lambda area: area.width * area.height)
    if area.type != kind:
        area.type = kind
    region = next(region for region in area.regions if region.type == "WINDOW")
    return {"window": window, "area": area, "region": region}


def move(where, x, y, *then):
    """Move the mouse to a place of an editor's drawing region, in pixels from its lower left corner."""
    window, region = where["window"], where["region"]
    _xdotool("mousemove", round(region.x + x), window.height - 1 - round(region.y + y), *then)


def click(where, x, y):
    """Press and release the left mouse button there."""
    move(where, x, y, "click", 1)


def scroll_sidebar(where, notches):
    """Turn the mouse wheel over an editor's sidebar."""
    sidebar = next(region for region in where["area"].regions if region.type == "UI")
    move(where | {"region": sidebar}, sidebar.width / 2, sidebar.height / 2, *["click", 5] * notches)


def press(*keys):
    """Press keys, named as X11 does, one after the other."""
    _xdotool("key", *keys)


def picture(path):
    """Take a picture of the whole display."""
    subprocess.run(["import", "-window", "root", str(path)], check=True)


def screen(folder):
    """What the display shows, shape (height, width, 3), 8 bits; Xvfb keeps it in a folder, as a window dump of X11."""
    data = (folder / "Xvfb_screen0").read_bytes()
    header = struct.unpack_from(">25I", data)
    size, width, height, bytes_per_line, colours = header[0], header[4], header[5], header[12], header[19]
    start = size + 12 * colours
    pixels = np.frombuffer(data, np.uint8, height * bytes_per_line, start).reshape(height, bytes_per_line // 4, 4)
    return pixels[:, :width, 2::-1]


def _xdotool(*words):
    subprocess.run(["xdotool", *map(str, words)], check=True)
