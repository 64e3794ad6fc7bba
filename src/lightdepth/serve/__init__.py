"""A process that renders for other programs."""
