from .acquisition import (
    Sensitivity as Sensitivity,
    acquire as acquire,
    acquire_prefixes as acquire_prefixes,
    expose as expose,
    incident_light as incident_light,
    pixel_of as pixel_of,
    row_parity as row_parity,
    scored_pixels as scored_pixels,
    sensitivity as sensitivity,
)
from .converter import full_scale_lsb as full_scale_lsb
from .description import description_of as description_of
from .drift import (
    distance_drift_m as distance_drift_m,
    imager_temperature_k as imager_temperature_k,
    residual_drift_m as residual_drift_m,
)
from .electrons import electrons_per_radiance_second as electrons_per_radiance_second
from .exposure import Exposure as Exposure
from .gray import (
    GrayNoise as GrayNoise,
    capture_gray as capture_gray,
    gray_exposure_s as gray_exposure_s,
    gray_gain_lsb_per_e as gray_gain_lsb_per_e,
    gray_noise as gray_noise,
    sample_noise_lsb as sample_noise_lsb,
)
from .noise import (
    Purpose as Purpose,
    noise_samples as noise_samples,
    stream as stream,
    stream_seed as stream_seed,
)
from .normals import (
    BLOCK as BLOCK,
    fill_normals_ as fill_normals_,
)
from .offsets import (
    OffsetPattern as OffsetPattern,
    draw_offsets as draw_offsets,
    offset_left_lsb as offset_left_lsb,
)
from .pixel_loops import (
    IncidentLight as IncidentLight,
    Pixel as Pixel,
    mark_scored_ as mark_scored_,
    noise_by_gray_ as noise_by_gray_,
    take_sample_ as take_sample_,
)
