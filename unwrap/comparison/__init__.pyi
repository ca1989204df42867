from .compared_frames import ComparedFrames as ComparedFrames
from .table_page import render_page as render_page
from .table_run import make_table as make_table
from .table_trainings import TableConfig as TableConfig
