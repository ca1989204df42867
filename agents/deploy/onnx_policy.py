"""A score network as an ONNX file, the guard inside, run once by onnxruntime before it stands."""

from __future__ import annotations

import json
from typing import Any, Final

import numpy as np

from agents.deploy.agreement import CheckCases, require_same_actions
from agents.policies import NetworkPolicy, linear_layers
from unwrap.signal import Shots

OPSET: Final = 17
"""Version of the ONNX operators: old enough for runtimes on devices, and has all that is used."""
OPERATORS: Final = {"tanh": "Tanh", "relu": "Relu"}


def onnx_policy(policy: NetworkPolicy, metadata: dict[str, str]) -> bytes:
    """ONNX file of `policy`, with `metadata` in it.

    Inputs are `observation` float32 [N, D] and `allowed` bool [N, 3]; outputs `action` int64 [N]
    and `scores` float32 [N, 3], those of actions that are not allowed too.
    """
    # Optional packages, which only exports need. The graph is four kinds of node: written here,
    # it needs no tracing and keeps N open.
    from onnx import TensorProto, checker, helper, numpy_helper

    layers = linear_layers(policy.network)
    weights, nodes = [numpy_helper.from_array(np.array(-np.inf, np.float32), "never")], []
    seen = "observation"
    for number, layer in enumerate(layers):
        for name, value in (("weight", layer.weight), ("bias", layer.bias)):
            weights.append(numpy_helper.from_array(value.numpy(), f"{name}{number}"))
        last = number == len(layers) - 1
        out = "scores" if last else f"sum{number}"
        inputs = [seen, f"weight{number}", f"bias{number}"]
        nodes.append(helper.make_node("Gemm", inputs, [out], transB=1))
        if not last:
            seen = f"layer{number}"
            nodes.append(helper.make_node(OPERATORS[policy.activation], [out], [seen]))
    nodes += [
        helper.make_node("Where", ["allowed", "scores", "never"], ["guarded"]),
        helper.make_node("ArgMax", ["guarded"], ["action"], axis=1, keepdims=0),
    ]

    def tensor(name: str, kind: int, *shape: int | str) -> Any:
        return helper.make_tensor_value_info(name, kind, shape)

    graph = helper.make_graph(
        nodes,
        "scheduler",
        [
            tensor("observation", TensorProto.FLOAT, "N", len(policy.feature_names)),
            tensor("allowed", TensorProto.BOOL, "N", len(Shots)),
        ],
        [
            tensor("action", TensorProto.INT64, "N"),
            tensor("scores", TensorProto.FLOAT, "N", len(Shots)),
        ],
        weights,
    )
    # The format's version that goes with the operators: newer packages would write a newer one.
    model = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=8, producer_name="shotenv"
    )
    helper.set_model_props(model, metadata)
    checker.check_model(model, full_check=True)
    return model.SerializeToString()


def onnx_metadata(policy: NetworkPolicy) -> dict[str, str]:
    """What is stored with the file, as text."""
    told = policy.provenance.model_dump(mode="json")
    return {name: v if isinstance(v, str) else json.dumps(v) for name, v in told.items()}


def check_onnx(content: bytes, cases: CheckCases) -> float:
    """Largest difference of scores between onnxruntime and torch.

    Raises
    ------
    ValueError
        They choose differently.
    """
    import onnxruntime

    session = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    inputs = {"observation": cases.observations, "allowed": cases.allowed}
    actions, scores = session.run(["action", "scores"], inputs)
    require_same_actions("onnxruntime", cases, actions)
    return float(np.abs(scores - cases.scores).max())
