from .page import write_report as write_report
from .results import (
    DRIVES as DRIVES,
    FRAMES as FRAMES,
    RESULTS as RESULTS,
    TIMELINE as TIMELINE,
    rival_note as rival_note,
    verdict as verdict,
    write_drives as write_drives,
    write_results as write_results,
    write_strip as write_strip,
)
from .strip import take_strip as take_strip
