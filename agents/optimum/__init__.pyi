from .choices import (
    always as always,
    best_choice as best_choice,
    best_rule as best_rule,
    blind_choices as blind_choices,
    threshold as threshold,
)
from .constrained import (
    MOST_TRIED as MOST_TRIED,
    ConstrainedOptimum as ConstrainedOptimum,
    bracket as bracket,
    constrained_optimum as constrained_optimum,
)
from .dynamic import clairvoyant as clairvoyant, greedy as greedy
from .fronts import (
    Front as Front,
    blind_front as blind_front,
    by_clip as by_clip,
    front_of as front_of,
)
from .outcome_table import DriveTable as DriveTable, PlayedTable as PlayedTable, play as play
from .tabulation import (
    Possible as Possible,
    clips_of as clips_of,
    drive_of as drive_of,
    frames_of as frames_of,
    tabulate as tabulate,
)
from .temporal_error import (
    STILL_M as STILL_M,
    tabulate_temporal_errors as tabulate_temporal_errors,
)
