"""Figures of the physics page, by stage: light, sensor, decoding, laser."""
