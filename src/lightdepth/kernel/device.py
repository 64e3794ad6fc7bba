"""Which kind of device computes; imported after ``kernel.start``."""

from __future__ import annotations

import mitsuba as mi

ON_GPU = str(mi.variant()).startswith("cuda")
"""Whether it is a GPU: it wants many lanes, and OptiX holds the intersections of a single scene in a kernel."""
