from .plan import TableConfig as TableConfig
from .results_table import make_table as make_table
