"""Mitsuba and Dr.Jit: the only folder that starts them, and that makes Mitsuba's objects out of the scene's."""
