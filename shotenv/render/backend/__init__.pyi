from .device import only_where as only_where, upload as upload
from .llvm import (
    CURE as CURE,
    OLDEST_LLVM as OLDEST_LLVM,
    RendererError as RendererError,
    chosen_variant as chosen_variant,
    find_llvm as find_llvm,
    limit_threads as limit_threads,
    require_device as require_device,
    require_llvm as require_llvm,
    start_mitsuba as start_mitsuba,
)
