"""A frame decodes to the same bits whatever the batch, also where maps fill no whole vectors."""

from __future__ import annotations

import pytest
import torch

from unwrap.signal.decoding import angle_rad, decode
from unwrap.support.process_state import torch_threads


@pytest.mark.parametrize("size", [(15, 20), (7, 13), (120, 160), (33, 47)])
@pytest.mark.parametrize("threads", [1, 2])
def test_a_frame_decodes_alike_in_every_batch(size, threads):
    dcs = 100 * torch.randn(40, 4, *size, generator=torch.Generator().manual_seed(0))
    alone = torch.cat([decode(frame[None]).phase_rad for frame in dcs])
    with torch_threads(threads):
        for batch in (1, 3, 40):
            together = torch.cat([decode(part).phase_rad for part in dcs.split(batch)])
            assert torch.equal(together, alone)


def test_angles_go_where_they_are_asked_to():
    sine, cosine = torch.randn(2, 3, 5, 7, generator=torch.Generator().manual_seed(1))
    expected = torch.atan2(sine, cosine)
    assert angle_rad(sine, cosine, out=cosine) is cosine
    torch.testing.assert_close(cosine, expected)
