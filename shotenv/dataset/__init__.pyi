from .bank_scores import (
    measure_unwrapping as measure_unwrapping,
    print_unwrapping as print_unwrapping,
)
from .export_inputs import (
    bank_export_frames as bank_export_frames,
    choose_check_bank as choose_check_bank,
)
from .sensed_frames import SensedFrames as SensedFrames
from .signal_statistics import light_statistics as light_statistics, print_light as print_light
from .source import (
    bench_config as bench_config,
    for_sensor as for_sensor,
    gray_warning as gray_warning,
    sources as sources,
)
from .thinning import thin_bank as thin_bank
