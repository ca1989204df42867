"""What every test of this folder starts from."""

import pytest
import torch


@pytest.fixture(autouse=True)
def _pinned_seed():
    """Images and weights that a test draws without a generator of its own are always the same."""
    torch.manual_seed(0)
