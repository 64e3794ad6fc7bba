"""Jobs for farms: each is the command that renders some frames, written down as an existing engine reads it."""
