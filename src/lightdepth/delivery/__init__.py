"""Delivery: finished frames as domes, headsets, players and browsers want them."""
