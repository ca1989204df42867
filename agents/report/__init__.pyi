from .answer import budget_lines as budget_lines, details as details, verdict as verdict
from .charts import (
    ACCENT as ACCENT,
    AXIS as AXIS,
    INK as INK,
    LEGEND as LEGEND,
    MUTED as MUTED,
    SHOT_COLORS as SHOT_COLORS,
    figure_html as figure_html,
    styled as styled,
)
from .comparison import write_comparison as write_comparison
from .evaluation_files import write_evaluation as write_evaluation
from .page import write_report as write_report
from .rerun_file import require_rerun as require_rerun, write_recording as write_recording
from .results import (
    DRIVES as DRIVES,
    RESULTS as RESULTS,
    label as label,
    read_json as read_json,
    write_drives as write_drives,
)
from .scoreboard import lines_of as lines_of, match_picture as match_picture
from .strip import take_strip as take_strip
from .template import CANNOT_SHOW as CANNOT_SHOW, page_of as page_of
