"""Tasks that want a GPU, on a Ray that is told of two and hands out their numbers."""

from __future__ import annotations

import pytest
import worker_tasks

from unwrap.execution import run_tasks

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", autouse=True)
def ray():
    import ray as module

    quiet = {"include_dashboard": False, "log_to_driver": False, "logging_level": "error"}
    module.init("local", num_cpus=4, num_gpus=2, object_store_memory=2**27, **quiet)
    yield module
    module.shutdown()


def test_each_task_has_a_gpu_of_its_own():
    seen = dict(run_tasks(worker_tasks.gpus_seen, range(6), executor="ray", gpu=True))
    assert set(seen.values()) == {"0", "1"}


def test_tasks_that_want_none_take_none():
    at_once = run_tasks(worker_tasks.gpus_seen, range(4), executor="ray")
    assert {seen for _, seen in at_once}.isdisjoint({"0", "1"})
