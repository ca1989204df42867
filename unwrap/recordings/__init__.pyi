from .file_correction import add_arguments as add_arguments, correct_files as correct_files
