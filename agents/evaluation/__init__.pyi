from .acceptance import judged as judged, print_problem as print_problem
from .episodes import (
    play_episodes as play_episodes,
    require_minari as require_minari,
    write_dataset as write_dataset,
)
from .front_measures import main_measures as main_measures, references as references
from .headroom import check_solvable as check_solvable, measure_problem as measure_problem
from .match import Match as Match, Tally as Tally
from .play import (
    FIXED_POLICIES as FIXED_POLICIES,
    PlayedDrives as PlayedDrives,
    drive_seeds as drive_seeds,
    make_envs as make_envs,
    play_drives as play_drives,
    play_optimum as play_optimum,
)
from .price_sweep import (
    PlayedFront as PlayedFront,
    play_blind as play_blind,
    play_front as play_front,
    prices_of as prices_of,
)
from .statistics import Interval as Interval, ratio as ratio, study_interval as study_interval
from .study import (
    Evaluation as Evaluation,
    check_study as check_study,
    evaluate_scheduler as evaluate_scheduler,
    families_of as families_of,
    price_of as price_of,
    table_fronts as table_fronts,
    tune_families as tune_families,
    without_tuning as without_tuning,
)
from .summary import (
    PACKAGES as PACKAGES,
    difference as difference,
    drive_rows as drive_rows,
    timeline as timeline,
)
from .tuning import (
    Tuned as Tuned,
    best_at_prices as best_at_prices,
    tune as tune,
    tuning_envs as tuning_envs,
)
