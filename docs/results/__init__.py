"""Parts of the page of a study: its answer, its tables, its picture."""
