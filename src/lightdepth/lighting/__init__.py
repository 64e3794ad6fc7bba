"""Light that the photograph lacks, recovered from what it lights: an unseen sun, sources that clipped."""
