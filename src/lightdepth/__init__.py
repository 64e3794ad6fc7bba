"""Render synthetic objects into 360 degree HDR panoramas that carry depth.

The folders are the production pipeline in its order: ``capture``, ``calibration``, ``reconstruction``, ``lightmap``,
``scene``, ``cameras``, ``transport``, ``film``. Beneath them lie ``errors``, ``directions`` and ``images``; ``kernel``
is the only folder that starts and feeds Mitsuba; ``cli`` is on top.
"""
