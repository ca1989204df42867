"""A seed becomes a world: geometry, materials, lights, motion. Knows no renderer."""
