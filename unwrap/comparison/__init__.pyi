from .plan import TableConfig as TableConfig
from .table import make_table as make_table
