"""Families of scenes: how each is laid out, and its traffic.

`settings.py` has one row per family: places, light, weather. A place is laid out by a function
`lay_out_...(site, rng)`. What changes the site is a verb: `build_...` for ground, walls and
ceilings, which nothing keeps off; `put_...` for things that stay out of each other's way, and are
left out where no room is free; `paint_...` for lines. What only draws a thing, and returns its
mesh, is named after the thing. Things that other families may show as well are in
`shotenv.world.things`; the files of held-out families have theirs to themselves.

Lane widths, bays and clear heights are usual ones. How often something is there (`rng.random() <
0.3`), how fast it moves and how far off it stands is assumed, so that clips differ and many have
something close by.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
