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

from unwrap.depth import RULES, Merge
from unwrap.export.export_frames import ExportFrames
from unwrap.networks import Needs, Prediction, Unwrapper, predict_thinned
from unwrap.signal import (
    GRAY_FULL_SCALE,
    RawFrame,
    Sensed,
    SensorDescription,
    unambiguous_range_m,
    wrapped_and_valid,
)

OPSET = 20


class Exported(nn.Module):
    """What an ONNX file computes: the names of its inputs and outputs are those of `forward`.

    Parameters
    ----------
    unwrapper : Unwrapper
    sensor : SensorDescription
    merge : "nearest", "floor" or "none"

    Raises
    ------
    ValueError
        The network was trained for another frequency.
    """

    def __init__(self, unwrapper: Unwrapper, sensor: SensorDescription, merge: Merge):
        super().__init__()
        unwrapper.require_frequency(sensor)
        self.network, self.stride = unwrapper.network, unwrapper.stride
        self.sensor, self.merge = sensor, merge

    def look(self, sensed: Sensed) -> Prediction:
        """The network's prediction for frames, which are thinned for it as `Unwrapper.predict_sensed` does.

        In float32 wherever it runs, so that a file does not depend on the machine that wrote it.
        """
        stride = self.stride(*sensed.gray.shape[-2:])
        return predict_thinned(self.network, sensed, self.sensor, stride)

    def merged(self, predicted_m: Tensor, wrapped_m: Tensor) -> Tensor:
        """Wrapped distance with the wraps that the prediction tells, all [1, H, W] in metres."""
        unambiguous_m = unambiguous_range_m(self.sensor.f1_hz)
        limit_m = self.sensor.saturation_range_m
        return RULES[self.merge].of_tensors(predicted_m, wrapped_m, unambiguous_m, limit_m)

    def wraps(self, distance_m: Tensor, wrapped_m: Tensor) -> Tensor:
        """Whole unambiguous ranges from `wrapped_m` to `distance_m`, rounded; int32 [1, H, W]."""
        turns = (distance_m - wrapped_m) / unambiguous_range_m(self.sensor.f1_hz)
        return turns.round().clamp(min=0).to(torch.int32)


class ExportedGray(Exported):
    """A gray image and a wrapped map to distance, by a network of the gray image alone."""

    def forward(self, gray: Tensor, wrapped_m: Tensor) -> dict[str, Tensor]:
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
        predicted_m = self.look(Sensed(fractions(gray))).distance_m
        distance_m = self.merged(predicted_m, wrapped_m)
        return {
            "predicted_m": predicted_m,
            "wraps": self.wraps(distance_m, wrapped_m),
            "distance_m": distance_m,
        }


class ExportedSamples(Exported):
    """A gray image and samples to distance, by a network that looks at both; without memory."""

    def forward(
        self,
        gray: Tensor,
        dcs_lsb: Tensor,
        saturated: Tensor,
        offset_lsb: Tensor,
        noise_lsb: Tensor,
        shift_m: Tensor,
    ) -> dict[str, Tensor]:
        """Predicted distance, wraps, corrected distance, confidence and validity.

        Parameters
        ----------
        gray : uint16 [1, H, W]
            12-bit gray image.
        dcs_lsb : float32 [1, n, H, W]
            Two or four samples at f1, finite.
        saturated : bool [1, H, W]
        offset_lsb, noise_lsb : float32 [1, H, W]
            Stored dark offset, and standard deviation of one sample, above 0.
        shift_m : float32 [1]
            Added to the wrapped distances, metres; see `unwrap.signal.calibrated.decode_at`.

        Returns
        -------
        predicted_m, wraps, distance_m : float32, int32, float32 [1, H, W]
            The network's distance; whole unambiguous ranges from the samples' own wrapped distance
            to `distance_m`, rounded; and what `unwrap.depth.correction.correct` makes of both.
        confidence, valid : float32, bool [1, H, W]
            The network's own, and where the signal is strong enough and not saturated.
        """
        # The exported arctangent takes minus zero, which rounding gives, for a negative number.
        dcs_lsb = torch.where(dcs_lsb == 0, 0.0, dcs_lsb)
        raw = RawFrame(dcs_lsb, saturated)
        sensed = Sensed(fractions(gray), raw, offset_lsb, noise_lsb, shift_m)
        prediction = self.look(sensed)
        predicted_m = prediction.distance_m
        wrapped_m, valid = wrapped_and_valid(sensed, self.sensor)
        distance_m = self.merged(predicted_m, wrapped_m).where(valid, predicted_m)
        return {
            "predicted_m": predicted_m,
            "wraps": self.wraps(distance_m, wrapped_m),
            "distance_m": distance_m,
            "confidence": prediction.confidence,
            "valid": valid,
        }


EXPORTED: dict[Needs, type[Exported]] = {"gray": ExportedGray, "samples": ExportedSamples}
"""By what the network looks at."""


def exported(unwrapper: Unwrapper, sensor: SensorDescription, merge: Merge) -> Exported:
    """What the file of a network computes, in evaluation mode; see `Exported`."""
    return EXPORTED[unwrapper.network.needs](unwrapper, sensor, merge).eval()


def fractions(gray: Tensor) -> Tensor:
    """12-bit gray image in [0, 1], float32."""
    return gray.to(torch.float32) / GRAY_FULL_SCALE


def to_onnx(
    exported: Exported, example: Mapping[str, Tensor], metadata: Mapping[str, str]
) -> bytes:
    """ONNX file of `exported` for frames of the shapes of `example`."""
    # Run once beforehand: what the sensor's tables keep must not be kept from a trace.
    outputs = _computed(exported, example)
    with _quiet():
        program = torch.onnx.export(
            exported,
            kwargs=dict(example),
            input_names=list(example),
            output_names=list(outputs),
            opset_version=OPSET,
            dynamo=True,
            verbose=False,
        )
    if program is None:
        raise RuntimeError("torch gave no ONNX program")
    return _serialised(program.model_proto, metadata)


def quantised(content: bytes, frames: ExportFrames) -> bytes:
    """The ONNX file `content` with convolutions in 8 bits, calibrated with `frames`.

    Those that see the logarithm of the gray level or the phase, and those that make distances or
    logits (`outer_convolutions`), stay float32: they are a small part of the work, and 8 bits there
    cost most of the accuracy.
    """
    import onnx
    from onnxruntime.quantization import CalibrationDataReader, quantize_static

    class Reader(CalibrationDataReader):
        """Hands out the frames one by one."""

        def __init__(self) -> None:
            self._inputs = iter(frames.one_by_one())

        def get_next(self) -> dict[str, np.ndarray] | None:
            """Next frame, None after the last."""
            inputs = next(self._inputs, None)
            return None if inputs is None else _arrays(inputs)

    model = onnx.load_from_string(content)
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    with _quiet(), tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "int8.onnx"
        quantize_static(
            model,
            path,
            Reader(),
            per_channel=True,
            op_types_to_quantize=["Conv"],
            nodes_to_exclude=outer_convolutions(model.graph),
        )
        return _serialised(onnx.load(path), {**metadata, "quantised": "int8"})


def outer_convolutions(graph) -> list[str]:
    """Convolutions with no other between them and the inputs, or between them and the outputs.

    `graph` is an ONNX graph, whose nodes are in the order of computation.
    """
    seen, made = {value.name for value in graph.input}, {value.name for value in graph.output}
    outer = []
    for nodes, known, near, far in (
        (graph.node, seen, "input", "output"),
        (reversed(graph.node), made, "output", "input"),
    ):
        for node in nodes:
            if known.isdisjoint(getattr(node, near)):
                continue
            if node.op_type == "Conv":
                outer.append(node.name)
            else:
                known.update(getattr(node, far))
    return outer


def _serialised(model, metadata: Mapping[str, str]) -> bytes:
    from onnx import checker, helper

    for node in model.graph.node:
        node.ClearField("metadata_props")  # Lines of source, by where they lie on this machine.
    helper.set_model_props(model, dict(metadata))
    checker.check_model(model)
    return model.SerializeToString()


def run(content: bytes, frames: ExportFrames) -> dict[str, Tensor]:
    """Outputs [N, H, W] of the ONNX file `content` by name, by onnxruntime on the CPU."""
    import onnxruntime

    session = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]
    outputs = [session.run(names, _arrays(inputs)) for inputs in frames.one_by_one()]
    maps = (torch.from_numpy(np.concatenate(one)) for one in zip(*outputs, strict=True))
    return dict(zip(names, maps, strict=True))


def run_torch(exported: Exported, frames: ExportFrames) -> dict[str, Tensor]:
    """Outputs [N, H, W] of torch itself by name, in float32."""
    outputs = [_computed(exported, inputs) for inputs in frames.one_by_one()]
    return {name: torch.cat([output[name] for output in outputs]) for name in outputs[0]}


@torch.inference_mode()
def _computed(exported: Exported, inputs: Mapping[str, Tensor]) -> dict[str, Tensor]:
    return exported(**inputs)


def _arrays(inputs: Mapping[str, Tensor]) -> dict[str, np.ndarray]:
    return {name: values.numpy() for name, values in inputs.items()}


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
