from .bank_scores import (
    measure_unwrapping as measure_unwrapping,
    print_unwrapping as print_unwrapping,
)
from .sensed_frames import SensedFrames as SensedFrames
from .source import sources as sources
