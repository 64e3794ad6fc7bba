"""The photographed place before insertion: its surfaces, its light, and how both are sampled."""
