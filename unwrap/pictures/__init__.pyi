from .colors import (
    CYCLIC as CYCLIC,
    ERROR as ERROR,
    GRAY as GRAY,
    VIRIDIS as VIRIDIS,
    ColorMap as ColorMap,
    paint as paint,
    picture as picture,
)
from .sheet import (
    FAINT as FAINT,
    GAP_PX as GAP_PX,
    LARGE_PX as LARGE_PX,
    MARGIN_PX as MARGIN_PX,
    NARROWEST_TILE_PX as NARROWEST_TILE_PX,
    SMALL_PX as SMALL_PX,
    bar as bar,
    column as column,
    enlarged as enlarged,
    framed as framed,
    line as line,
    text as text,
)
