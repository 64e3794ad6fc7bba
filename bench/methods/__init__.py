"""The compared methods: lightdepth's own, Debevec's two passes on stock Mitsuba, Cycles and LuxCore."""
