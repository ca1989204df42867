from .draw import draw_world as draw_world
