"""Networks as ONNX: with what comes before and after them, in float32 or quantised."""

from __future__ import annotations

import logging
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from agents.export_frames import ExportFrames
from unwrap.correction import MERGES, Merge, SensorDescription
from unwrap.data import GRAY_FULL_SCALE
from unwrap.phase import unambiguous_range_m
from unwrap.sensed import Sensed
from unwrap.sizes import enlarged, thinned
from unwrap.unwrapper import Unwrapper

INPUTS = ("gray", "wrapped_m")
OUTPUTS = ("predicted_m", "wraps", "distance_m")
OPSET = 20


class Exported(nn.Module):
    """A gray image and a wrapped map to distance: what an ONNX file computes.

    Parameters
    ----------
    unwrapper : Unwrapper
        Of a network that looks at the gray image alone.
    sensor : SensorDescription
    merge : "nearest" or "floor"

    Raises
    ------
    ValueError
        The network needs samples, or was trained for another frequency.
    """

    def __init__(self, unwrapper: Unwrapper, sensor: SensorDescription, merge: Merge):
        super().__init__()
        if unwrapper.network.needs != "gray":
            raise ValueError(
                f"{unwrapper.name} needs the samples of each frame; expected a network that looks "
                "at the gray image alone, such as tofregnet or tofsegnet"
            )
        unwrapper.require_frequency(sensor)
        self.network, self.stride = unwrapper.network, unwrapper.stride
        self.sensor, self.merge = sensor, merge

    def forward(self, gray: Tensor, wrapped_m: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Predicted distance, wraps and corrected distance.

        Parameters
        ----------
        gray : uint16 [1, H, W]
            12-bit gray image.
        wrapped_m : float32 [1, H, W]
            Distance within the unambiguous range at f1, metres.

        Returns
        -------
        predicted_m, wraps, distance_m : float32, int32, float32 [1, H, W]
            The network's distance; whole unambiguous ranges from `wrapped_m` to `distance_m`,
            rounded; and the two merged.
        """
        stride = self.stride(*gray.shape[-2:])
        shown = thinned(Sensed(gray.to(torch.float32) / GRAY_FULL_SCALE), stride)
        output = self.network(self.network.features(shown, self.sensor))
        shown_m = self.network.predict(output, shown, self.sensor).distance_m
        predicted_m = enlarged(shown_m, stride)
        unambiguous_m = unambiguous_range_m(self.sensor.f1_hz)
        distance_m = MERGES[self.merge](
            predicted_m, wrapped_m, unambiguous_m, self.sensor.saturation_range_m
        )
        wraps = ((distance_m - wrapped_m) / unambiguous_m).round().clamp(min=0)
        return predicted_m, wraps.to(torch.int32), distance_m


def to_onnx(exported: Exported, size: tuple[int, int], metadata: Mapping[str, str]) -> bytes:
    """ONNX file of `exported` for images of `size`, height and width."""
    gray = torch.zeros(1, *size, dtype=torch.uint16)
    with _quiet():
        program = torch.onnx.export(
            exported,
            (gray, torch.zeros(1, *size)),
            input_names=INPUTS,
            output_names=OUTPUTS,
            opset_version=OPSET,
            dynamo=True,
            verbose=False,
        )
    if program is None:
        raise RuntimeError("torch gave no ONNX program")
    return _serialised(program.model_proto, metadata)


def quantised(content: bytes, frames: ExportFrames) -> bytes:
    """The ONNX file `content` with convolutions in 8 bits, calibrated with `frames`.

    The first convolution, which sees the logarithm of the gray level, and the last, which makes
    distances or logits, stay float32: they are a small part of the work, and 8 bits there cost most
    of the accuracy.
    """
    import onnx
    from onnxruntime.quantization import CalibrationDataReader, quantize_static

    class Reader(CalibrationDataReader):
        """Hands out the frames one by one."""

        def __init__(self) -> None:
            self._inputs = iter(frames.inputs())

        def get_next(self) -> dict[str, np.ndarray] | None:
            """Next frame, None after the last."""
            return next(self._inputs, None)

    model = onnx.load_from_string(content)
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    convolutions = [node.name for node in model.graph.node if node.op_type == "Conv"]
    with _quiet(), tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "int8.onnx"
        quantize_static(
            model,
            path,
            Reader(),
            per_channel=True,
            op_types_to_quantize=["Conv"],
            nodes_to_exclude=[convolutions[0], convolutions[-1]],
        )
        return _serialised(onnx.load(path), {**metadata, "quantised": "int8"})


def _serialised(model, metadata: Mapping[str, str]) -> bytes:
    from onnx import checker, helper

    helper.set_model_props(model, dict(metadata))
    checker.check_model(model)
    return model.SerializeToString()


def run(content: bytes, frames: ExportFrames) -> list[Tensor]:
    """Outputs [N, H, W] of the ONNX file `content`, by onnxruntime on the CPU."""
    import onnxruntime

    session = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    outputs = [session.run(list(OUTPUTS), inputs) for inputs in frames.inputs()]
    return [torch.from_numpy(np.concatenate(maps)) for maps in zip(*outputs, strict=True)]


@torch.inference_mode()
def run_torch(exported: Exported, frames: ExportFrames) -> list[Tensor]:
    """Outputs [N, H, W] of torch itself, in float32."""
    pairs = zip(frames.gray.split(1), frames.wrapped_m.split(1), strict=True)
    outputs = [exported(gray, wrapped_m) for gray, wrapped_m in pairs]
    return [torch.cat(maps) for maps in zip(*outputs, strict=True)]


@contextmanager
def _quiet() -> Iterator[None]:
    """Without what exporters tell of their own insides."""
    disabled = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(disabled)
