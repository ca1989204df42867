from .bench_files import (
    BENCH_FILE as BENCH_FILE,
    Bench as Bench,
    BenchConfig as BenchConfig,
    RecordingConfig as RecordingConfig,
    read_bench as read_bench,
    setting_of as setting_of,
    stretch_of as stretch_of,
)
from .camera_numbers import (
    Assumed as Assumed,
    Calibration as Calibration,
    amplitudes_of as amplitudes_of,
    calibrate_camera as calibrate_camera,
    drift_of_distance as drift_of_distance,
    is_dark as is_dark,
)
from .delays import rad_per_m as rad_per_m, wall_curves as wall_curves, wall_phases as wall_phases
from .full_well import taps_e as taps_e
from .intervals import CONFIDENCE as CONFIDENCE, Estimate as Estimate
from .moments import (
    Moments as Moments,
    MomentsInPieces as MomentsInPieces,
    Setting as Setting,
    moments_of as moments_of,
)
from .overtones import overtone_factor as overtone_factor, wiggle_columns as wiggle_columns
from .photon_transfer import (
    ambient_e as ambient_e,
    gray_gain as gray_gain,
    has_electrons as has_electrons,
)
from .sensor_file import (
    interval_text as interval_text,
    number_text as number_text,
    sensor_text as sensor_text,
)
