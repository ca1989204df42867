"""A network as ONNX files, each checked against torch before it stands."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

from torch import Tensor

from unwrap.depth import Merge, nearest_wraps
from unwrap.export.export_frames import ExportFrames
from unwrap.export.onnx_conversion import onnx_outputs, quantised_onnx, to_onnx, torch_outputs
from unwrap.export.onnx_graph import Exported
from unwrap.networks import Unwrapper
from unwrap.signal import SensorDescription, Shots, unambiguous_range_m
from unwrap.support import write_bytes

CHECKED_FRAMES, CALIBRATION_FRAMES = 16, 32
LEAST_SAME_WRAPS = 0.999
"""Share of pixels that must have torch's own wrap; assumed. Not 1: half way between two candidates
rounding decides."""


class CheckedExport:
    """A network's files for frames of one size.

    Parameters
    ----------
    network : Exported
    frames : ExportFrames
        What the files are checked with; their size is the files'.
    metadata : mapping of str to str
        Stored with the files, see `metadata_of`.
    """

    def __init__(self, network: Exported, frames: ExportFrames, metadata: Mapping[str, str]):
        self._frames = frames
        self._content = to_onnx(network, frames.one_by_one()[0], metadata)
        # Torch computes once what both files are held against.
        self._judge = Judge(frames, network.sensor.f1_hz, torch_outputs(network, frames))

    def write(self, path: Path) -> dict[str, Any]:
        """Write the float32 file and return the numbers of its check, its name and its size.

        Raises
        ------
        ValueError
            It disagrees with torch; nothing is written then.
        """
        found = self._judge(onnx_outputs(self._content, self._frames))
        require_agreement(found["same_wraps"])
        write_bytes(path, self._content)
        return {**found, "file": str(path), "bytes": len(self._content)}

    def write_int8(self, path: Path, calibration: ExportFrames) -> dict[str, Any]:
        """Write the file with 8-bit convolutions, and return numbers as `write` does.

        Whether it agrees with torch well enough is for the reader of the numbers to say.

        Parameters
        ----------
        calibration : ExportFrames
            Training frames, whose activations the 8 bits are spread over.
        """
        content = quantised_onnx(self._content, calibration)
        found = self._judge(onnx_outputs(content, self._frames))
        write_bytes(path, content)
        file = {"file": str(path), "bytes": len(content)}
        return {"calibration": calibration.source, **found, **file}


def shots_of(unwrapper: Unwrapper, shots: int | None) -> Shots | None:
    """Samples that the file takes; None for a network that looks at the gray image alone.

    Raises
    ------
    ValueError
        `shots` are neither two nor four, or asked for of such a network.
    """
    if unwrapper.network.needs == "gray":
        if shots is not None:
            alone = f"{unwrapper.name} looks at the gray image alone"
            raise ValueError(f"shots is {shots}; expected none, since {alone}")
        return None
    if shots not in (None, Shots.TWO, Shots.FOUR):
        raise ValueError(f"shots is {shots}; expected 2 or 4")
    return Shots(shots or Shots.FOUR)


def metadata_of(
    unwrapper: Unwrapper,
    merge: Merge,
    sensor: SensorDescription,
    sensor_name: str,
    size: tuple[int, int],
    shots: Shots | None,
) -> dict[str, str]:
    """What is stored with the file: where it comes from and what its inputs mean."""
    values = {
        "network": unwrapper.name,
        "width": unwrapper.metadata["width"],
        "fingerprint": unwrapper.fingerprint,
        "shotenv_version": version("shotenv"),
        "sensor": sensor_name,
        "f1_hz": sensor.f1_hz,
        "unambiguous_m": unambiguous_range_m(sensor.f1_hz),
        "saturation_range_m": sensor.saturation_range_m,
        "merge": merge,
        "image_height": size[0],
        "image_width": size[1],
        "every_row_and_column": unwrapper.stride(*size),
    }
    if shots is not None:
        values |= {"shots": int(shots), "min_snr": sensor.min_snr}
    # The metadata of an ONNX file is text alone.
    return {name: str(value) for name, value in values.items()}


class Judge:
    """Compares outputs with torch's, and with the truth where it is known.

    Parameters
    ----------
    frames : ExportFrames
    f1_hz : float
        Modulation frequency that the wraps belong to.
    reference : dict of str to Tensor
        Torch's outputs.
    """

    def __init__(self, frames: ExportFrames, f1_hz: float, reference: dict[str, Tensor]):
        self.frames, self.f1_hz, self.reference = frames, f1_hz, reference

    def __call__(self, outputs: dict[str, Tensor]) -> dict[str, Any]:
        """Shares of equal wraps, differences of the predicted distance, and both accuracies."""
        wraps, wraps_torch = outputs["wraps"], self.reference["wraps"]
        apart_m = (outputs["predicted_m"] - self.reference["predicted_m"]).abs()
        return {
            "same_wraps": (wraps == wraps_torch).double().mean().item(),
            "mean_difference_m": apart_m.mean().item(),
            "largest_difference_m": apart_m.max().item(),
            "wrap_accuracy": self._accuracy(wraps),
            "wrap_accuracy_torch": self._accuracy(wraps_torch),
        }

    def _accuracy(self, wraps: Tensor) -> float | None:
        """Share of the scored pixels with the right wrap; None without truth."""
        truth_m, scored = self.frames.truth_m, self.frames.scored
        if truth_m is None or scored is None:
            return None
        right = nearest_wraps(truth_m, self.frames.wrapped_m, unambiguous_range_m(self.f1_hz))
        return (wraps == right)[scored].double().mean().item()


def require_agreement(same_wraps: float) -> None:
    """Raise ValueError unless the share of equal wraps is enough."""
    # Written so that NaN, which compares false, is refused as well.
    if not same_wraps >= LEAST_SAME_WRAPS:
        raise ValueError(
            f"onnxruntime and torch agree on the wrap of {100 * same_wraps:.3f} % of the pixels; "
            f"expected at least {100 * LEAST_SAME_WRAPS:g} %; nothing was written"
        )
