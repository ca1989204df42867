from .frames import SensedFrames as SensedFrames
from .scores import measure_unwrapping as measure_unwrapping, print_unwrapping as print_unwrapping
from .source import sources as sources
