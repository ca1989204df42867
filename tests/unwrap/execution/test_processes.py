"""Worker processes: repeatable, named when they fail, and none that lingers."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import torch_tasks
import worker_tasks
from watched_processes import end_session, is_alive, wait_until

from unwrap.execution import places
from unwrap.execution.cores import available_cores
from unwrap.execution.places import visible, wait_for_file
from unwrap.execution.tasks import run_tasks
from unwrap.execution.work import WorkerError
from unwrap.support import StoppedWatch, workers


def test_tasks_come_back_with_their_results_from_replaced_workers():
    done = dict(run_tasks(worker_tasks.squared, range(3), workers=1, tasks_per_worker=2))
    assert {task: square for task, (square, _) in done.items()} == {i: i * i for i in range(3)}
    assert len({pid for _, pid in done.values()}) == 2
    assert not multiprocessing.active_children()


@pytest.mark.slow
def test_workers_share_the_cores_with_torch_too():
    share = max(1, available_cores() // 2)
    assert dict(run_tasks(torch_tasks.threads, [0], workers=2)) == {0: share}


def test_workers_share_the_cores_with_numpy_too():
    share = max(1, available_cores() // 2)
    assert dict(run_tasks(worker_tasks.blas_threads, [0], workers=2)) == {0: {share}}


def test_leaving_the_loop_ends_the_workers():
    for _ in run_tasks(worker_tasks.squared, iter(int, 1), workers=2):
        break
    assert not multiprocessing.active_children()


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (worker_tasks.fail_at_three, "task 3 failed: KeyError: 'no such lamp'"),
        (worker_tasks.killed_at_three, r"task 3 failed: its worker process \d+ died \(SIGKILL\)"),
        (worker_tasks.stopped_at_three, r"task 3 hangs: worker \d+ was stopped"),
        (worker_tasks.unpicklable_at_three, "task 3 failed: .*pickle"),
        (worker_tasks.unreadable_at_three, "task 3 failed: TypeError: .*reason"),
    ],
)
def test_a_failing_task_is_named_soon(function, message, monkeypatch):
    monkeypatch.setattr(workers, "STOPPED_LIMIT_S", 1.0)
    results = run_tasks(function, [1, 3], workers=1)
    assert next(results) == (1, 1)
    start = time.monotonic()
    with pytest.raises(WorkerError, match=message):
        next(results)
    assert time.monotonic() - start < 60
    assert not multiprocessing.active_children()


def test_a_worker_that_dies_while_it_sends_is_named(tmp_path):
    """Its result is larger than the pipe, and nobody takes it before it is dead."""
    first, killed = tmp_path / "first", tmp_path / "killed"
    results = run_tasks(
        worker_tasks.killed_while_it_sends, [first, killed], workers=2, keep_going=True
    )
    assert next(results) == (first, b"")
    killed.with_suffix(".go").touch()
    wait_until(lambda: killed.exists() and killed.read_text())
    wait_until(lambda: not is_alive(int(killed.read_text())))
    task, error = next(results)
    assert isinstance(error, WorkerError) and f"{task!r} failed: its worker" in str(error)
    assert next(results, None) is None


def test_a_process_hangs_only_after_it_was_seen_stopped_for_long(monkeypatch):
    """Not where who looks was away, stopped by Ctrl-Z for example, until just now."""
    monkeypatch.setattr(workers, "STOPPED_LIMIT_S", 0.3)
    sleeper = subprocess.Popen(["sleep", "60"])
    try:
        watch = StoppedWatch(sleeper.pid)
        assert not watch.hangs()
        time.sleep(0.4)
        sleeper.send_signal(signal.SIGSTOP)
        wait_until(lambda: workers._is_stopped(sleeper.pid))
        assert not watch.hangs()
        time.sleep(0.4)
        assert watch.hangs()
        sleeper.send_signal(signal.SIGCONT)
        assert not watch.hangs()
    finally:
        sleeper.kill()
        sleeper.wait()


@pytest.mark.parametrize("name", ["workers", "threads", "tasks_per_worker"])
def test_counts_of_workers_are_checked(name):
    counts = {name: 0}
    with pytest.raises(ValueError, match=f"{name} is 0; expected at least 1"):
        list(run_tasks(worker_tasks.squared, [1], **counts))


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGKILL])
def test_no_worker_outlives_its_parent(ending, tmp_path):
    script = Path(worker_tasks.__file__)
    parent = subprocess.Popen(
        [sys.executable, str(script), str(tmp_path), "local"],
        start_new_session=True,
        stderr=subprocess.DEVNULL,
    )
    try:
        wait_until(lambda: len(list(tmp_path.iterdir())) == 2)
        if ending == signal.SIGINT:
            os.killpg(parent.pid, ending)
        else:
            parent.send_signal(ending)
        parent.wait(timeout=60)
        wait_until(lambda: not any(is_alive(int(path.name)) for path in tmp_path.iterdir()))
    finally:
        end_session(parent)


def test_others_go_on_after_a_failure_where_that_is_asked_for():
    """Also after a death: the worker is replaced."""
    for function in (worker_tasks.fail_at_three, worker_tasks.killed_at_three):
        done = dict(run_tasks(function, [3, 1, 2], workers=1, keep_going=True))
        assert (done[1], done[2]) == (1, 2)
        assert isinstance(done[3], WorkerError) and "task 3 failed: " in str(done[3])


def test_errors_that_may_pass_are_raised_as_they_are():
    with pytest.raises(KeyError, match="no such lamp") as caught:
        list(run_tasks(worker_tasks.fail_at_three, [3], workers=1, passing=(LookupError,)))
    assert "task 3" not in str(caught.value)


def test_a_task_can_wait_for_another():
    """None holds the second back, though a worker is free, until the first is through."""
    finished: list[int] = []

    def tasks():
        yield 1
        while not finished:
            yield None
        yield 2

    for task, (square, _) in run_tasks(worker_tasks.squared, tasks(), workers=2):
        finished.append(task)
        assert square == task * task
    assert finished == [1, 2]


def test_workers_are_made_ready_once_each():
    done = run_tasks(
        worker_tasks.prepared_with, range(3), workers=1, threads=3, prepare=worker_tasks.prepare
    )
    assert [counts for _, counts in done] == [[3], [3], [3]]


def test_an_unknown_executor_is_refused():
    with pytest.raises(ValueError, match="executor is 'slurm'; expected one of local, ray"):
        list(run_tasks(worker_tasks.squared, [1], executor="slurm"))


def test_a_folder_that_is_not_seen_is_named_with_the_machine(tmp_path):
    assert visible(tmp_path) == tmp_path
    with pytest.raises(WorkerError, match=r"machine \S+ does not see the folder .*/elsewhere"):
        visible(tmp_path / "elsewhere")


def test_a_file_of_another_machine_is_waited_for_and_one_of_this_is_not(tmp_path, monkeypatch):
    monkeypatch.setattr(places, "CHECK_S", 0.01)
    own, others = tmp_path / "own", tmp_path / "others"
    assert not wait_for_file(own, "local")
    looks = iter((False, False, True))
    monkeypatch.setattr(Path, "is_file", lambda path: path == others and next(looks))
    assert wait_for_file(others, "ray") and next(looks, None) is None
    monkeypatch.setattr(places, "SEEN_S", 0.05)
    assert not wait_for_file(own, "ray")
