"""Tasks on a Ray of this machine: the same results, failures by name, nothing left behind."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
import worker_tasks
from watched_processes import is_alive, wait_until

from unwrap.execution import ray_tasks
from unwrap.execution.tasks import run_tasks
from unwrap.execution.work import WorkerError
from unwrap.support import workers


@pytest.fixture(scope="module", autouse=True)
def ray():
    """One Ray for all of these tests, which takes seconds to start."""
    with ray_tasks.connected(2) as module:
        yield module


def on_ray(function, tasks, **options):
    return run_tasks(function, tasks, executor="ray", **options)


def test_tasks_come_back_with_their_results_from_replaced_workers():
    done = dict(on_ray(worker_tasks.squared, range(6), workers=2, tasks_per_worker=2))
    assert {task: square for task, (square, _) in done.items()} == {i: i * i for i in range(6)}
    pids = [pid for _, pid in done.values()]
    assert len(set(pids)) >= 3 and max(map(pids.count, pids)) <= 2
    assert os.getpid() not in pids


def test_no_more_tasks_are_at_work_than_workers():
    """Endless tasks are taken one by one, as workers are free for them."""
    taken = []

    def tasks():
        while True:
            taken.append(len(taken))
            yield taken[-1]

    for finished, _ in enumerate(on_ray(worker_tasks.squared, tasks(), workers=2), start=1):
        # Two at work, and with the one that has just come back.
        assert len(taken) <= finished + 2
        if finished == 5:
            break


def test_a_raising_task_is_named_and_the_others_go_on_where_that_is_asked_for():
    with pytest.raises(WorkerError, match="task 3 failed: KeyError: 'no such lamp'") as caught:
        list(on_ray(worker_tasks.fail_at_three, [1, 3]))
    assert "fail_at_three" in caught.value.__notes__[0], "the worker's traceback"
    done = dict(on_ray(worker_tasks.fail_at_three, [3, 1], keep_going=True))
    assert done[1] == 1 and "no such lamp" in str(done[3])
    with pytest.raises(KeyError, match="no such lamp"):
        list(on_ray(worker_tasks.fail_at_three, [3], passing=(LookupError,)))


def test_a_task_whose_worker_dies_runs_again(tmp_path):
    marks = [str(tmp_path / name) for name in ("one", "two")]
    assert dict(on_ray(worker_tasks.killed_once, marks)) == dict.fromkeys(marks, "through")


@pytest.mark.slow
def test_a_stopped_worker_is_named_and_its_task_runs_again(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(workers, "STOPPED_LIMIT_S", 1.0)
    mark = tmp_path / "mark"
    assert dict(on_ray(worker_tasks.stopped_once, [str(mark)])) == {str(mark): "through"}
    assert re.search(
        r"^worker \d+ was stopped; its task begins again$", capsys.readouterr().err, re.M
    )
    assert time.time() - mark.stat().st_mtime < 60


def test_a_task_whose_worker_always_dies_is_named(monkeypatch):
    monkeypatch.setattr(ray_tasks, "TRIES", 2)
    with pytest.raises(WorkerError, match="task 3 failed: its worker died 2 times"):
        list(on_ray(worker_tasks.killed_at_three, [3]))


def test_workers_are_made_ready_once_for_each_run(monkeypatch, tmp_path):
    monkeypatch.setenv("SHOTENV_TEST", "seen")
    monkeypatch.chdir(tmp_path)
    for run in (1, 2):
        done = on_ray(
            worker_tasks.surroundings, [0], workers=1, threads=2, prepare=worker_tasks.prepare
        )
        ((_, (prepared, variable, folder)),) = done
        assert (variable, folder) == ("seen", str(tmp_path))
        assert prepared[-1] == 2 and len(prepared) <= run


def test_a_function_that_no_machine_finds_is_named():
    with pytest.raises(WorkerError, match=r"task 1 failed: .*No module named 'nowhere_to_be'"):
        list(on_ray(worker_tasks.found_nowhere(), [1]))


def test_ray_that_is_not_installed_is_named_with_its_cure(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ImportError, match=r"pip install 'shotenv\[scale\]'"):
        list(on_ray(worker_tasks.squared, [1]))


@pytest.mark.slow
@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGKILL])
def test_no_worker_outlives_its_parent(ending, tmp_path):
    """Of a Ray of its own, which ends with it."""
    marks, log = tmp_path / "marks", tmp_path / "log"
    marks.mkdir()
    with log.open("w") as told:
        parent = subprocess.Popen(
            [sys.executable, worker_tasks.__file__, str(marks), "ray"],
            start_new_session=True,
            stdout=told,
            stderr=told,
        )
    try:
        wait_until(lambda: len(list(marks.iterdir())) == 2, seconds=60)
        children = [int(path.name) for path in marks.iterdir()]
        daemons = daemons_of(parent.pid)
        assert daemons
        if ending == signal.SIGINT:
            os.killpg(parent.pid, ending)
        else:
            parent.send_signal(ending)
        parent.wait(timeout=60)
    finally:
        print(log.read_text())
        parent.kill()
        parent.wait()
    wait_until(lambda: not any(map(is_alive, (*children, *daemons))))
    if ending == signal.SIGINT:
        assert log.read_text().rstrip().endswith("KeyboardInterrupt")


def daemons_of(parent: int) -> list[int]:
    """Ray's own processes that a process has started."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, _, rest = path.read_text().partition("(")[2].rpartition(")")
        except OSError:
            continue
        if int(rest.split()[1]) == parent and name in ("raylet", "gcs_server"):
            found.append(int(path.parent.name))
    return found


def test_a_cluster_that_does_not_answer_is_named(monkeypatch):
    with socket.socket() as nobody:
        # Bound, but nobody listens.
        nobody.bind(("127.0.0.1", 0))
        address = "127.0.0.1:{1}".format(*nobody.getsockname())
        monkeypatch.setenv("RAY_ADDRESS", address)
        monkeypatch.setattr("ray.is_initialized", lambda: False)
        with pytest.raises(ConnectionError, match=f"RAY_ADDRESS is '{address}', where nobody"):
            list(on_ray(worker_tasks.squared, [1]))
