"""A seed becomes a world: geometry, materials, lights, motion. Knows no renderer."""

from shotenv.world.draw import draw_world

__all__ = ["draw_world"]
