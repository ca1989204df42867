"""What must not break, measured where a test would take too long, by `make reliability`.

Each module with a function `measure(progress) -> list[Row]` is a measurement, named like its file;
its docstring says what is promised. Its rows are kept in `docs/reliability/NAME.json`, and
`docs/reliability.md` is made of them and of the tests that hold the other promises.
As tests do, measurements import by file what is behind a door.
"""
