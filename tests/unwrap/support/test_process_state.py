"""What is changed of the whole process: freed memory is kept, threads are set for a while."""

import subprocess
import sys

import pytest
import torch

from unwrap.support.process_state import keep_freed_memory, torch_threads

PAGES = """
import resource, sys
import torch
from unwrap.support.process_state import keep_freed_memory
if sys.argv[1] == "keep":
    keep_freed_memory()
def use():
    torch.ones(32 << 20, dtype=torch.uint8)
for _ in range(30):  # Small allocations come to lie between the first ones.
    use()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(10):
    use()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def pages_mapped(how: str) -> int:
    """Pages that ten more tensors of 32 MiB make a process map."""
    command = [sys.executable, "-c", PAGES, how]
    return int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="asks the GNU C library")
def test_freed_memory_is_used_again():
    if pages_mapped("leave") < 1000:
        pytest.skip("this C library keeps freed memory by itself")
    assert pages_mapped("keep") < 100


def test_other_systems_are_left_alone(monkeypatch):
    monkeypatch.setattr(sys, "platform", "darwin")
    assert not keep_freed_memory()


def test_threads_are_those_of_before_behind_the_context():
    before = torch.get_num_threads()
    with pytest.raises(KeyError), torch_threads(before + 1):
        assert torch.get_num_threads() == before + 1
        raise KeyError
    assert torch.get_num_threads() == before
