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


def test_each_task_has_a_gpu_of_its_own(tmp_path):
    tasks = [(tmp_path, 2, number) for number in range(2)]
    seen = run_tasks(worker_tasks.gpus_of_company, tasks, executor="ray", gpu=True)
    assert sorted(found for _, found in seen) == [["0"], ["1"]]


def test_tasks_that_want_none_take_none(tmp_path):
    # Four at once, where two would be all if they took one each.
    tasks = [(tmp_path, 4, number) for number in range(4)]
    seen = run_tasks(worker_tasks.gpus_of_company, tasks, executor="ray", workers=4)
    assert [found for _, found in seen] == [[]] * 4
