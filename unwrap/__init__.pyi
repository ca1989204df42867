from .depth import (
    correct as correct,
    depth_metrics as depth_metrics,
    merge_nearest as merge_nearest,
    merge_regression as merge_regression,
    merge_segmentation as merge_segmentation,
    unwrap_dual as unwrap_dual,
    unwrap_frequencies as unwrap_frequencies,
)
from .networks import (
    Prediction as Prediction,
    TofRegNet as TofRegNet,
    TofSegNet as TofSegNet,
    Unwrapper as Unwrapper,
    depth_guided_loss as depth_guided_loss,
    load_unwrapper as load_unwrapper,
    regression_loss as regression_loss,
    scale_invariant_loss as scale_invariant_loss,
    ssim_loss as ssim_loss,
)
from .signal import (
    SensorDescription as SensorDescription,
    Shots as Shots,
    decode as decode,
    distance_m as distance_m,
    unambiguous_range_m as unambiguous_range_m,
)
