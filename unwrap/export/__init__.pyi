from .check import add_arguments as add_arguments, export_files as export_files
