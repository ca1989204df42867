from .calibrated import decode_at as decode_at, phase_at as phase_at, samples_at as samples_at
from .decoding import (
    TWO_PI as TWO_PI,
    angle_pixels as angle_pixels,
    angle_rad as angle_rad,
    decode as decode,
    decode_pixels as decode_pixels,
    distance_m as distance_m,
    quadratures as quadratures,
)
from .description import SensorDescription as SensorDescription
from .frame_checks import check_frames as check_frames
from .frames import DepthFrame as DepthFrame, PhaseFrame as PhaseFrame, RawFrame as RawFrame
from .frequencies import (
    SPEED_OF_LIGHT_M_S as SPEED_OF_LIGHT_M_S,
    candidate_spacing_m as candidate_spacing_m,
    joint_range_m as joint_range_m,
    unambiguous_range_m as unambiguous_range_m,
)
from .sensed import (
    Memory as Memory,
    Sensed as Sensed,
    Truth as Truth,
    first_phase as first_phase,
    is_strong as is_strong,
    sample_noise_lsb as sample_noise_lsb,
    wrapped_and_valid as wrapped_and_valid,
    wrapped_distance_m as wrapped_distance_m,
)
from .shots import (
    SAMPLES_PER_FREQUENCY as SAMPLES_PER_FREQUENCY,
    Shots as Shots,
    demodulation_phase_rad as demodulation_phase_rad,
    frequency_index as frequency_index,
    harmonic_weights as harmonic_weights,
    sample_times_s as sample_times_s,
)
from .wiggle import (
    FLAT as FLAT,
    TurnsTable as TurnsTable,
    WiggleTable as WiggleTable,
    correlation_samples as correlation_samples,
    measure_wiggle as measure_wiggle,
    read_wiggle as read_wiggle,
    wiggle_of as wiggle_of,
    wrap_phase as wrap_phase,
    write_wiggle as write_wiggle,
)
from .words import (
    ADC_BITS as ADC_BITS,
    GRAY_FULL_SCALE as GRAY_FULL_SCALE,
    from_words as from_words,
    mid_scale as mid_scale,
    to_words as to_words,
)
