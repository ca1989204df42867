"""Networks to the bytes of ONNX files, in float32 or quantised, and what either computes."""

from __future__ import annotations

import logging
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from unwrap.export.export_frames import ExportFrames
from unwrap.export.onnx_graph import Exported

OPSET = 20
"""Version of the ONNX operators that files are written with."""


def to_onnx(network: Exported, example: Mapping[str, Tensor], metadata: Mapping[str, str]) -> bytes:
    """ONNX file of `network` for frames of the shapes of `example`, with `metadata` in it."""
    # Run once beforehand: what the sensor's tables keep must not be kept from a trace.
    with torch.inference_mode():
        outputs = network(**example)
    with _quiet():
        program = torch.onnx.export(
            network,
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


def quantised_onnx(content: bytes, frames: ExportFrames) -> bytes:
    """The ONNX file `content` with convolutions in 8 bits, calibrated with `frames`.

    Those that see the logarithm of the gray level or the phase, and those that make distances or
    logits (`outer_convolutions`), stay float32: they are a small part of the work, and 8 bits there
    cost most of the accuracy.
    """
    import onnx  # Here and below: optional packages, which only exports need.
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
    # Taken over by hand, since the quantiser makes a model of its own.
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    with _quiet(), tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "int8.onnx"
        # A scale for each channel: one for all would leave the weak channels a few levels of 256.
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
    # Twice the same walk: what only cheap nodes part from the inputs, then from the outputs.
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


def onnx_outputs(content: bytes, frames: ExportFrames) -> dict[str, Tensor]:
    """Outputs [N, H, W] of the ONNX file `content` by name, by onnxruntime on the CPU."""
    import onnxruntime

    # One frame at a time, as the file takes them, and always on the processor, so that what a check
    # finds does not depend on what else is installed.
    session = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]
    outputs = [session.run(names, _arrays(inputs)) for inputs in frames.one_by_one()]
    maps = (torch.from_numpy(np.concatenate(one)) for one in zip(*outputs, strict=True))
    return dict(zip(names, maps, strict=True))


@torch.inference_mode()
def torch_outputs(network: Exported, frames: ExportFrames) -> dict[str, Tensor]:
    """Outputs [N, H, W] of torch itself by name, in float32."""
    outputs = [network(**inputs) for inputs in frames.one_by_one()]
    return {name: torch.cat([output[name] for output in outputs]) for name in outputs[0]}


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
