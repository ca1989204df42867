from .acquire import (
    Acquisition as Acquisition,
    acquire_depth as acquire_depth,
    acquire_depths as acquire_depths,
    noise_of as noise_of,
)
from .drive import Drive as Drive, DriveOptions as DriveOptions, draw_drive as draw_drive
from .features import (
    FEATURE_NAMES as FEATURE_NAMES,
    FEATURES as FEATURES,
    LIMIT as LIMIT,
    SCENE_FEATURES as SCENE_FEATURES,
    SEEN_FEATURES as SEEN_FEATURES,
    feature_index as feature_index,
    heat_margin_k as heat_margin_k,
)
from .measurement import (
    Measure as Measure,
    Measurement as Measurement,
    measure_frames as measure_frames,
)
from .measurement_cache import MeasurementCache as MeasurementCache
from .outcomes import Outcomes as Outcomes, outcomes_of_all_actions as outcomes_of_all_actions
from .problem import Problem as Problem, open_problem as open_problem, problem_of as problem_of
from .rewards import TERMS as TERMS, weighted as weighted
from .scenes import (
    Scenes as Scenes,
    look_at_scenes as look_at_scenes,
    probe_features as probe_features,
)
from .score import no_depth as no_depth
from .state import State as State, observe as observe
from .transition import (
    Outcome as Outcome,
    allowed_actions as allowed_actions,
    answered_actions as answered_actions,
    drive_of_seed as drive_of_seed,
    reset as reset,
    step as step,
)
