"""Renderings as something to steer: started, paused, cancelled, changed; they report events and show their picture."""
