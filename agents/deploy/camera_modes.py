"""Cycles as the sequence that Analog Devices' ToF SDK hands its camera: dynamic mode switching.

The SDK reads `"dynamicModeSwitching": [{"mode": m, "repeat": n}, ...]` of its configuration file
and repeats the sequence for ever. It packs modes and repeats into four bits each, of eight entries
at most, and drops what is beyond, so that longer sequences are refused here (analogdevicesinc/
libaditof, sdk/src/cameras/itof-camera/camera_itof.cpp: `loadDepthParamsFromJsonFile` and
`adsds3500setDynamicModeSwitchingSequence`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any, Final

import numpy as np

from agents.policies import Policy
from unwrap.signal import Shots

MOST_ENTRIES, MOST_REPEATS, HIGHEST_MODE = 8, 15, 14
"""Of the SDK. Mode 15 is what entries that are not used are filled with."""
LONGEST: Final = MOST_ENTRIES * MOST_REPEATS


def mode_switching(policy: Policy, modes: Mapping[int, int]) -> dict[str, Any]:
    """The SDK's table of `policy`, which must look at nothing, as a cycle does.

    Parameters
    ----------
    modes : mapping of int to int
        Camera mode that takes each number of samples.

    Raises
    ------
    ValueError
        Samples without a mode, a mode that cannot be, or a cycle that does not fit.

    Examples
    --------
    >>> from agents.policies import CyclePolicy
    >>> mode_switching(CyclePolicy(4, shots=8, otherwise=2), {8: 3, 2: 1})
    {'dynamicModeSwitching': [{'mode': 3, 'repeat': 1}, {'mode': 1, 'repeat': 3}]}
    """
    cycle = one_cycle(policy)
    missing = sorted({shots for shots in cycle if shots not in modes})
    if missing:
        raise ValueError(
            f"modes has no mode for {', '.join(map(str, missing))} samples; "
            f"expected one for each of {', '.join(map(str, sorted(set(cycle))))}"
        )
    for shots in set(cycle):
        if not 0 <= modes[shots] <= HIGHEST_MODE:
            raise ValueError(
                f"modes has {modes[shots]} for {shots} samples; expected 0 to {HIGHEST_MODE}"
            )
    entries = []
    for mode, frames in groupby(modes[shots] for shots in cycle):
        left = len(list(frames))
        while left:
            repeat = min(left, MOST_REPEATS)
            entries.append({"mode": mode, "repeat": repeat})
            left -= repeat
    if len(entries) > MOST_ENTRIES:
        raise ValueError(
            f"the cycle of {len(cycle)} frames takes {len(entries)} entries of at most "
            f"{MOST_REPEATS} frames; expected at most {MOST_ENTRIES}"
        )
    return {"dynamicModeSwitching": entries}


def one_cycle(policy: Policy) -> list[int]:
    """Samples of each frame of one cycle, found by playing it twice.

    Raises
    ------
    ValueError
        No cycle of at most `LONGEST` frames.
    """
    policy.reset()
    nothing = np.zeros(0, np.float32)
    played = [SHOTS[policy.act(nothing)] for _ in range(2 * LONGEST)]
    policy.reset()
    for length in range(1, LONGEST + 1):
        if played[length:] == played[:-length]:
            return played[:length]
    raise ValueError(f"the policy has no cycle of at most {LONGEST} frames")


SHOTS: Final = tuple(int(shots) for shots in Shots)
"""Samples of each action."""


def modes_of_shots(pairs: Sequence[str]) -> dict[int, int]:
    """Modes from words as `8=3`: 8 samples are camera mode 3.

    Raises
    ------
    ValueError
        A word of another form, samples that there are not, or the same samples twice.
    """
    modes: dict[int, int] = {}
    for pair in pairs:
        shots, equals, mode = pair.partition("=")
        if not (equals and shots.isdecimal() and mode.isdecimal() and int(shots) in SHOTS):
            raise ValueError(f"modes has {pair!r}; expected SHOTS=MODE, SHOTS being 2, 4 or 8")
        if int(shots) in modes:
            raise ValueError(f"modes has {shots} samples twice; expected each once")
        modes[int(shots)] = int(mode)
    return modes
