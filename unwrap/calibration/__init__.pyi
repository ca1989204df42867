from .camera_numbers import (
    Assumed as Assumed,
    Calibration as Calibration,
    amplitudes_of as amplitudes_of,
    calibrate as calibrate,
)
from .intervals import CONFIDENCE as CONFIDENCE, Estimate as Estimate
from .moments import Moments as Moments, Setting as Setting, moments_of as moments_of
