from .amplitude import unwrap_amplitude as unwrap_amplitude
from .confidence import (
    expected_calibration_error as expected_calibration_error,
    fit_temperature as fit_temperature,
)
from .correction import (
    Eight as Eight,
    correct as correct,
    correct_sensed as correct_sensed,
    merge_limits as merge_limits,
    shift_in_turns as shift_in_turns,
    turns_table as turns_table,
)
from .kernel_density import (
    KernelDensity as KernelDensity,
    unwrap_kernel_density as unwrap_kernel_density,
    vote_frequencies as vote_frequencies,
)
from .merge import (
    RULES as RULES,
    Limits as Limits,
    Merge as Merge,
    merge_nearest as merge_nearest,
    merge_pixels as merge_pixels,
    merge_regression as merge_regression,
    merge_segmentation as merge_segmentation,
    nearest_wraps as nearest_wraps,
)
from .metrics import depth_metrics as depth_metrics
from .multi_frequency import (
    DualLimits as DualLimits,
    dual_limits as dual_limits,
    fuse_pixels as fuse_pixels,
    unwrap_dual as unwrap_dual,
    unwrap_frequencies as unwrap_frequencies,
)
from .reflectance import ReflectancePrior as ReflectancePrior, calibrate as calibrate
from .scoring import (
    Scores as Scores,
    evaluate as evaluate,
    mean_scores as mean_scores,
    score as score,
)
from .warp import focal_px as focal_px, move_depth as move_depth, points_of as points_of
