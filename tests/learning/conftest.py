import learnability as script
import pytest
import torch


@pytest.fixture
def learnability():
    """The script of the docs, on one thread."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield script
    torch.set_num_threads(threads)


@pytest.fixture
def over_fixed(learnability):
    """Trains an algorithm; its return over each fixed choice's, on the same drives."""

    def over_fixed(algorithm, steps=learnability.STEPS):
        agent = learnability.train(algorithm, seed=0, steps=steps)
        drives = learnability.played({"agent": agent})
        return learnability.compared(drives.pop("agent"), drives)

    return over_fixed
