"""A first scene from any panorama: what can be found is found, the rest is guessed and says so."""
