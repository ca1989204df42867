"""`shotenv unwrap export`: a network as an ONNX file, checked against torch before it stands."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Any

from jsonargparse import ArgumentParser, Namespace
from torch import Tensor

from shotenv.config import SensorConfig, env_config
from shotenv.sensor import description_of
from unwrap.depth import Merge, nearest_wraps
from unwrap.export.export_frames import ExportFrames, choose_bank, export_frames
from unwrap.export.onnx_files import OPSET, exported, quantised, run, run_torch, to_onnx
from unwrap.networks import Unwrapper, load_unwrapper
from unwrap.signal import Shots, unambiguous_range_m
from unwrap.support import write_bytes

CHECKED_FRAMES, CALIBRATION_FRAMES = 16, 32
LEAST_SAME_WRAPS = 0.999
"""Share of pixels that must have torch's own wrap."""


def add_arguments(parser: ArgumentParser) -> None:
    """Arguments of `shotenv unwrap export`."""
    parser.add_argument("unwrapper", help="name or path of a network")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.onnx")
    parser.add_argument("--height", type=int, default=240, help="pixels down")
    parser.add_argument("--width", type=int, default=320, help="pixels across")
    parser.add_argument(
        "--shots",
        type=int,
        metavar="N",
        help="samples of each frame, 2 or 4 (default), for a network that looks at them",
    )
    parser.add_argument("--sensor", default="epc660", help="name or path of a sensor configuration")
    parser.add_argument(
        "--merge", type=Merge, default="nearest", help="nearest, floor (eq. 6), or none"
    )
    parser.add_argument("--int8", action="store_true", help="write FILE.int8.onnx, quantised, too")
    parser.add_argument(
        "--check-bank",
        metavar="BANK",
        help="name or path of a bank to check and calibrate with, or none: made-up images "
        "(default: starter where it is rendered, else none)",
    )


def export_files(arguments: Namespace) -> dict[str, Any]:
    """Export the network that the arguments name, tell and return the numbers of the check.

    Raises
    ------
    ValueError
        A network, sensor, bank or size that is of no use, or a file that disagrees with torch,
        which is not written then.
    """
    config = env_config(sensor=arguments.sensor)
    unwrapper, size = load_unwrapper(arguments.unwrapper), _size(arguments)
    shots = shots_of(unwrapper, arguments.shots)
    network = exported(unwrapper, description_of(config.sensor), arguments.merge)
    bank = choose_bank(arguments.check_bank, config.sensor)
    frames = export_frames(bank, "test", CHECKED_FRAMES, size, config, shots)
    metadata = metadata_of(unwrapper, arguments.merge, config.sensor, size, shots)
    content = to_onnx(network, frames.one_by_one()[0], metadata)
    judge = Judge(frames, config.sensor.f1_hz, run_torch(network, frames))
    found: dict[str, Any] = {
        "frames": frames.source,
        "opset": OPSET,
        "onnx": judge(run(content, frames)),
    }
    require_agreement(found["onnx"]["same_wraps"])
    _write(arguments.out, content, found["onnx"])
    if arguments.int8:
        training = export_frames(bank, "train", CALIBRATION_FRAMES, size, config, shots)
        small = quantised(content, training)
        found["int8"] = {"calibration": training.source, **judge(run(small, frames))}
        _write(arguments.out.with_suffix(".int8.onnx"), small, found["int8"])
    return found


def _size(arguments: Namespace) -> tuple[int, int]:
    for name in ("height", "width"):
        if not 16 <= arguments[name] <= 4096:
            raise ValueError(f"{name} is {arguments[name]}; expected 16 to 4096 pixels")
    return arguments.height, arguments.width


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
    sensor: SensorConfig,
    size: tuple[int, int],
    shots: Shots | None,
) -> dict[str, str]:
    """What is stored with the file: where it comes from and what its inputs mean."""
    values = {
        "network": unwrapper.name,
        "width": unwrapper.metadata["width"],
        "fingerprint": unwrapper.fingerprint,
        "shotenv_version": version("shotenv"),
        "sensor": sensor.name,
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
    if not same_wraps >= LEAST_SAME_WRAPS:
        raise ValueError(
            f"onnxruntime and torch agree on the wrap of {100 * same_wraps:.3f} % of the pixels; "
            f"expected at least {100 * LEAST_SAME_WRAPS:g} %; nothing was written"
        )


def _write(path: Path, content: bytes, found: dict[str, Any]) -> None:
    write_bytes(path, content)
    found["file"], found["bytes"] = str(path), len(content)
    told = f"{path}: {len(content) / 1e6:.1f} MB, same wrap as torch in "
    told += f"{100 * found['same_wraps']:.3f} % of the pixels"
    if found["wrap_accuracy"] is not None:
        told += (
            f"; right wrap in {100 * found['wrap_accuracy']:.2f} %, "
            f"torch {100 * found['wrap_accuracy_torch']:.2f} %"
        )
    print(told)
