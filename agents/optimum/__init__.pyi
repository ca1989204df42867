from .choices import (
    best_choice as best_choice,
    blind_choices as blind_choices,
    describe_rule as describe_rule,
    fixed as fixed,
    threshold as threshold,
    tuned_rule as tuned_rule,
)
from .dynamic import clairvoyant as clairvoyant, greedy as greedy
from .outcome_table import DriveTable as DriveTable, Played as Played, play as play
from .tabulation import Possible as Possible, drive_of as drive_of, tabulate as tabulate
