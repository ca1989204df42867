from .answer import details as details, verdict as verdict
from .calibration_page import write_calibration_page as write_calibration_page
from .evaluation_files import write_evaluation as write_evaluation
from .page import write_report as write_report
from .scoreboard import lines_of as lines_of, match_picture as match_picture
from .strip import take_strip as take_strip
