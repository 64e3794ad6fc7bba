"""Accumulation, noise estimate, layers, tone mapping, denoising."""
