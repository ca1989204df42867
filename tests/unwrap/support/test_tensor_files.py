"""Content of safetensors files: the same of the same, and what went in comes out."""

import json

import torch
from safetensors import safe_open
from safetensors.torch import load, save

from unwrap.support import tensor_bytes

TENSORS = {"b": torch.arange(6.0).reshape(2, 3).T, "a": torch.tensor(7, dtype=torch.int64)}
WORDS = {name: json.dumps({"of": name, "ü": [1.5]}) for name in "zyxwvutsrq"}


def test_equal_tensors_and_words_are_equal_files():
    backwards = dict(reversed(WORDS.items()))
    # The library leaves the order of words to chance: of ten, twenty times the same is none.
    contents = {tensor_bytes(TENSORS, words) for words in (WORDS, backwards) for _ in range(10)}
    assert len(contents) == 1


def test_the_library_reads_them(tmp_path):
    content = tensor_bytes(TENSORS, WORDS)
    (tmp_path / "some.safetensors").write_bytes(content)
    with safe_open(tmp_path / "some.safetensors", framework="pt") as file:
        assert file.metadata() == WORDS
    for found in (load(content), load(tensor_bytes(TENSORS))):
        assert found.keys() == TENSORS.keys()
        assert all(torch.equal(found[name], tensor) for name, tensor in TENSORS.items())


def test_a_file_without_words_is_the_librarys():
    whole = {name: tensor.contiguous() for name, tensor in TENSORS.items()}
    assert tensor_bytes(TENSORS) == save(whole)
