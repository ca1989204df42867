"""Every method that the results table can show: its name in the rows and what its page tells."""

from __future__ import annotations

from dataclasses import dataclass

from unwrap.networks import NetworkName


@dataclass(frozen=True)
class Entry:
    """One method.

    Attributes
    ----------
    label : str
        What names of its rows begin with.
    sees : str
        What it makes depth of.
    source : str
        Where it is from, and what about it is ours.
    """

    label: str
    sees: str
    source: str


PAPER = "Nagiub et al. 2023; with the paper's losses and flips, or our loss"
NETWORKS: dict[NetworkName, Entry] = {
    "tofregnet": Entry("TofRegNet", "gray image", PAPER),
    "tofsegnet": Entry("TofSegNet", "gray image", PAPER),
    "toffusionnet": Entry(
        "TofFusionNet (ours)",
        "gray image, phase, amplitude; with memory also its own depth of the frame before, moved "
        "by ego motion",
        "ours",
    ),
    "su_net": Entry(
        "end to end (Su et al. 2018)",
        "samples",
        "Su, Heide, Wetzstein and Heidrich 2018, without the adversarial loss",
    ),
    "phasenet": Entry(
        "PhaseNet (Spoorthi et al. 2019)", "phase", "Spoorthi, Gorthi and Gorthi 2019"
    ),
    "agresti_net": Entry(
        "light network (Agresti et al.)",
        "wrapped depth, amplitude",
        "Agresti, Schäfer, Sartor and Zanuttigh 2019",
    ),
    "chen_net": Entry("denoiser (Chen et al. 2020)", "samples, gray image", "Chen et al. 2020"),
}
TWO_FREQUENCIES = Entry(
    "two frequencies, nearest candidate",
    "8 samples",
    "nearest pair of candidates within the range; saturated pixels count as 0 m",
)
KERNEL_DENSITY = Entry(
    "kernel density (Järemo-Lawin et al. 2016)",
    "8 samples",
    "Järemo-Lawin, Forssén and Ovrén 2016",
)
AMPLITUDE = Entry(
    "amplitude (Crabb and Manduchi 2014)", "amplitude and smoothness", "Crabb and Manduchi 2014"
)
ENTRIES = (*NETWORKS.values(), TWO_FREQUENCIES, KERNEL_DENSITY, AMPLITUDE)
