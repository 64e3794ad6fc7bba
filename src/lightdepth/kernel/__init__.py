"""Mitsuba and Dr.Jit: the only folder that starts them and feeds them."""
