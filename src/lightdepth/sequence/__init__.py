"""Many frames of one scene: numbered files, made once, by any number of processes."""
