"""Sessions: renderings that can be started, paused, cancelled and changed; they report events and show their picture."""
