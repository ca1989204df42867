"""The tiny bank, and a thinned one made of it."""

from __future__ import annotations

import pytest

from shotenv.bank.opening import open_bank
from shotenv.bank.thinned import ThinnedBank
from shotenv.dataset.thinning import thin_bank


@pytest.fixture(scope="session")
def full(tiny_bank):
    return open_bank(tiny_bank)


@pytest.fixture(scope="session")
def thinned(full, tiny_unwrapper, session_cache, tmp_path_factory) -> ThinnedBank:
    folder = tmp_path_factory.mktemp("thinned") / "small"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SHOTENV_CACHE", session_cache)
        return thin_bank(full, folder, every=4, seed=3, networks=[tiny_unwrapper])
