from .recorded_page import (
    recorded_lines as recorded_lines,
    write_recorded_report as write_recorded_report,
)
from .recorded_study import (
    evaluate_recordings as evaluate_recordings,
    tells_less as tells_less,
)
