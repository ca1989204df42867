"""What never changes while drives are played: bank, predictions, configuration."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import torch
from torch import Tensor

from shotenv.bank import (
    Bank,
    BankError,
    Clip,
    PredictedDistances,
    StoredNetwork,
    ThinnedBank,
    WordBank,
    check_fits,
    find_thinned,
    keep_predictions,
    open_bank,
    require_full,
)
from shotenv.config import TRAINING_FAMILIES, EnvConfig
from shotenv.decision.scenes import Scenes, look_at_scenes, stored_scenes
from shotenv.laser import NetworkWork
from shotenv.sensor import description_of
from unwrap.networks import Unwrapper, label_of, load_unwrapper, network_class
from unwrap.signal import SensorDescription

GRAY_NETWORK = "tofregnet"
"""What is seen of a frame before any sample is taken comes from this network where the chosen one
needs samples."""
PROBLEMS_OPEN = 4
"""Problems that `open_problem` keeps for the process, those used last: a study's, which are all,
training, validation and test drives. Each holds its networks, 80 numbers per bank frame
(`Scenes` and exposures), and maps of files (bank and kept predictions), which the system reads as
they are used and drops when memory is short."""


@dataclass(frozen=True)
class Problem:
    """Parameters of the decision problem; `open_problem` makes one from a configuration.

    Attributes
    ----------
    config : EnvConfig
    bank : Bank
    clips : tuple of Clip
        Those of the chosen split; of the families for training only where `clutter` asks for it.
    kept : PredictedDistances
        Distances from the gray image of each of the bank's frames: the chosen network's, or
        `GRAY_NETWORK`'s where that one needs samples.
    fusion : Unwrapper or None
        The chosen network where it needs samples: it predicts in each acquisition, from what that
        has brought. None where `kept` is the prediction.
    scenes : Scenes
        What is seen of each frame before any sample is taken.
    gray_exposure_s : float64 [N]
        Exposure time of each frame's gray image.
    network_work : NetworkWork
        What the networks compute in a frame.
    description : SensorDescription
        What the correction must know of the sensor.
    """

    config: EnvConfig
    bank: Bank
    clips: tuple[Clip, ...]
    kept: PredictedDistances
    fusion: Unwrapper | None
    scenes: Scenes
    gray_exposure_s: Tensor
    network_work: NetworkWork
    description: SensorDescription

    def __reduce__(self):
        # Another process opens bank and network for itself, and shares the pages of their files.
        return (open_problem, (self.config,))

    @property
    def frame_period_s(self) -> float:
        """Seconds from frame to frame."""
        return 1.0 / self.config.frame_rate_hz


@lru_cache(maxsize=PROBLEMS_OPEN)
def open_problem(config: EnvConfig) -> Problem:
    """Open bank and network of `config`; environments of one process share the result.

    The last `PROBLEMS_OPEN` stay open.

    Raises
    ------
    ValueError
        The bank or the network is missing or damaged, the bank was rendered for another sensor or
        frame rate, or a network that needs samples was trained for other frequencies.
    """
    if (thinned := find_thinned(config.bank)) is not None:
        return thinned_problem(thinned, config)
    # Networks first: where one is missing, nobody should wait minutes for a rendering.
    networks = load_networks(config.unwrapper, description_of(config.sensor))
    return problem_of(open_bank(config.bank), config, networks)


def thinned_problem(bank: ThinnedBank, config: EnvConfig) -> Problem:
    """The problem of a thinned bank; see `open_problem`."""
    check_fits(bank, config.sensor, frame_rate_hz=config.frame_rate_hz)
    if config.eight == "kernel_density":
        require_full(bank, f"eight={config.eight!r}")
    clips = clips_driven(bank, config)
    # No network is loaded: what it makes of the full frames is in the bank.
    network = stored_network(bank, config.unwrapper)
    return Problem(
        config=config,
        bank=bank,
        clips=clips,
        kept=bank.predictions(network),
        fusion=None,
        scenes=stored_scenes(bank, clips, network),
        gray_exposure_s=torch.from_numpy(bank.gray_exposure_s),
        network_work=NetworkWork(gray=network.macs),
        description=description_of(config.sensor),
    )


def problem_of(
    bank: Bank, config: EnvConfig, networks: tuple[Unwrapper, Unwrapper | None] | None = None
) -> Problem:
    """The problem of a bank that is open and has whole images; see `open_problem`.

    `networks` are those that `load_networks` gives.

    Raises
    ------
    ValueError
        As `open_problem`, or a clip was recorded with settings that the configuration's laser or
        sensor cannot have.
    """
    description = description_of(config.sensor)
    gray, fusion = networks or load_networks(config.unwrapper, description)
    check_fits(bank, config.sensor, frame_rate_hz=config.frame_rate_hz)
    clips = clips_driven(bank, config)
    if isinstance(bank, WordBank):
        check_settings(bank, clips, config)
    images = keep_predictions(bank, gray)
    size = bank.height, bank.width
    work = NetworkWork(gray=gray.macs(*size), samples=0.0 if fusion is None else fusion.macs(*size))
    return Problem(
        config=config,
        bank=bank,
        clips=clips,
        kept=images,
        fusion=fusion,
        scenes=look_at_scenes(bank, clips, images, config.sensor),
        gray_exposure_s=torch.from_numpy(bank.gray_exposure_s),
        network_work=work,
        description=description,
    )


def check_settings(bank: WordBank, clips: tuple[Clip, ...], config: EnvConfig) -> None:
    """Refuse clips that were recorded in a way that laser and sensor of `config` cannot have.

    Raises
    ------
    BankError
        Names clip, value and bound.
    """
    bounds = {
        "ambient_k": (config.laser.release_k, "laser.release_k, where a tripped laser comes back"),
        "integration_s": (config.sensor.sample_period_s, "sensor.sample_period_s"),
    }
    for clip in clips:
        own = bank.settings(clip)
        for name, (below, what) in bounds.items():
            if getattr(own, name) >= below:
                raise BankError(
                    f"{name} of clip {clip.name} in bank {bank.name} is {getattr(own, name):g}; "
                    f"expected less than {below:g}, {what}"
                )


def clips_driven(bank: Bank, config: EnvConfig) -> tuple[Clip, ...]:
    """Clips of the chosen split that drives pass.

    Raises
    ------
    BankError
        The bank has no clip in that split, none of the chosen families, or only those of families
        for training networks.
    """
    clips = bank.splits(config.split)
    if config.families:
        known = sorted({clip.family for clip in clips})
        if unknown := [name for name in config.families if name not in known]:
            raise BankError(
                f"families has {unknown[0]!r}, of which bank {bank.folder} has no clip in split "
                f"{config.split!r}; expected some of {', '.join(known)}"
            )
        return tuple(clip for clip in clips if clip.family in config.families)
    if config.clutter:
        return clips
    # Schedulers are trained on drives like those that they are tested on.
    driven = tuple(clip for clip in clips if clip.family not in TRAINING_FAMILIES)
    if not driven:
        raise BankError(
            f"bank {bank.folder} has clips of {', '.join(TRAINING_FAMILIES)} alone in split "
            f"{config.split!r}, which drives leave out; set clutter to true, or choose another bank"
        )
    return driven


def stored_network(bank: ThinnedBank, name_or_path: str) -> StoredNetwork:
    """The network of that name or path in a thinned bank, which is not loaded.

    Raises
    ------
    ValueError
        The network is missing, needs samples, or the bank has no predictions of its weights.
    """
    label = label_of(name_or_path)
    if network_class(label.network).needs == "samples":
        require_full(bank, label.network)
    return bank.network(label)


def load_networks(
    name_or_path: str, description: SensorDescription
) -> tuple[Unwrapper, Unwrapper | None]:
    """The network that looks at the gray image alone, and the one that needs samples, if chosen.

    Raises
    ------
    ValueError
        The network is missing or damaged, or needs samples of another frequency.
    """
    unwrapper = load_unwrapper(name_or_path)
    if unwrapper.network.needs == "gray":
        return unwrapper, None
    unwrapper.require_frequency(description)
    return load_unwrapper(GRAY_NETWORK), unwrapper
