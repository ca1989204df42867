from .evaluation_files import write_evaluation as write_evaluation
from .page import write_report as write_report
from .results import rival_note as rival_note, verdict as verdict
from .strip import take_strip as take_strip
