from .headroom import (
    SHOTS as SHOTS,
    check_solvable as check_solvable,
    measure_problem as measure_problem,
    print_problem as print_problem,
)
from .play import Played as Played, drive_seeds as drive_seeds, play_drives as play_drives
from .study import (
    evaluate_scheduler as evaluate_scheduler,
    train_scheduler as train_scheduler,
)
