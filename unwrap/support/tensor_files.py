"""Tensors and words about them as the content of a safetensors file, which holds no pickle."""

from __future__ import annotations

import json
from collections.abc import Mapping

from torch import Tensor


def tensor_bytes(tensors: Mapping[str, Tensor], words: Mapping[str, str] | None = None) -> bytes:
    """Content of a safetensors file; equal tensors and words are equal files.

    Parameters
    ----------
    tensors
        Each may be of any memory layout.
    words
        The file's metadata, which is text alone.
    """
    from safetensors.torch import save

    # safetensors refuses tensors that do not lie in one piece.
    whole = {name: tensor.contiguous() for name, tensor in tensors.items()}
    content = save(whole, None if words is None else dict(words))
    # It orders tensors by type and name, and leaves the order of words to chance.
    end = 8 + int.from_bytes(content[:8], "little")
    header = json.loads(content[8:end])
    if words is not None:
        header["__metadata__"] = dict(sorted(words.items()))
    told = json.dumps(header, separators=(",", ":"), ensure_ascii=False).encode()
    told += b" " * (-len(told) % 8)
    return len(told).to_bytes(8, "little") + told + content[end:]
