"""A network compiled by OpenVINO, which runs on processors several times faster than torch.

OpenVINO arranges the weights for the processor once, where torch does so for every frame. Only this
module knows it: it is an optional package (the extra `fast`).
"""

from __future__ import annotations

import sys
import threading
import warnings
from functools import cache
from importlib.util import find_spec
from typing import Any

import torch
from torch import Tensor, nn

PRECISIONS = {torch.float32: "f32", torch.bfloat16: "bf16"}


@cache
def can_compile() -> bool:
    """Whether OpenVINO is installed (the extra `fast`)."""
    return find_spec("openvino") is not None


@cache
def _core() -> Any:
    """OpenVINO's runtime, one for the process."""
    # OpenVINO reports its use to its maker through the package `openvino_telemetry`, and does
    # without where that cannot be imported: None in `sys.modules` makes an import fail. It must be
    # there before OpenVINO is imported. A program that has imported the package itself keeps it.
    sys.modules.setdefault("openvino_telemetry", None)  # type: ignore[arg-type]
    import openvino

    return openvino.Core()


class CompiledNetwork:
    """`network` compiled for features of one shape; calls wait for each other.

    Parameters
    ----------
    network : Module
        On the processor, in evaluation mode.
    features : float32 [1, C, H, W]
        An example; results depend on its shape alone.
    arithmetic : dtype
        float32 or bfloat16.
    threads : int
        Of OpenVINO's own; torch's do not count here.
    """

    def __init__(self, network: nn.Module, features: Tensor, arithmetic: torch.dtype, threads: int):
        core = _core()  # Before the import, see there.
        import openvino

        with warnings.catch_warnings():
            # The trace holds for this shape alone, and it is used for no other.
            warnings.simplefilter("ignore")
            model = openvino.convert_model(network, example_input=features)
        # The conversion leaves the sizes open; this network has but one.
        model.reshape(list(features.shape))
        options = {
            "PERFORMANCE_HINT": "LATENCY",
            "INFERENCE_PRECISION_HINT": PRECISIONS[arithmetic],
            "INFERENCE_NUM_THREADS": threads,
            # Processes side by side would be held to the same cores.
            "ENABLE_CPU_PINNING": False,
        }
        # A request holds the memory of one computation: the lock keeps two threads from sharing it.
        self._request = core.compile_model(model, "CPU", options).create_infer_request()
        self._free = threading.Lock()

    def __call__(self, features: Tensor) -> Tensor:
        """What the network computes, float32."""
        with self._free:
            # The features are read where they lie; the output is a copy, which the next call leaves
            # alone.
            (output,) = self._request.infer([features.numpy()], share_inputs=True).values()
        return torch.from_numpy(output)
