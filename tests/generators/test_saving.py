"""Damaged model folders are named errors, whatever was damaged."""

import json

import numpy as np
import pytest

from prior_reinforce.errors import FileFormatError
from prior_reinforce.generators import load_generator
from prior_reinforce.generators.saving import (
    CONFIG_FILE,
    TENSOR_FILE,
    SavedModel,
    read_model,
    write_model,
)

TENSORS = {"a": np.arange(6, dtype=np.float32).reshape(2, 3), "b": np.array([np.pi])}
SETTINGS = {"gain": 0.1, "widths": [1, 2], "name": "x"}


@pytest.fixture
def folder(tmp_path):
    write_model(tmp_path / "model", SavedModel("some kind", SETTINGS, TENSORS))
    return tmp_path / "model"


def test_what_is_written_is_read(folder):
    saved = read_model(folder, expected="some kind")
    assert saved.settings == SETTINGS
    assert saved.tensors.keys() == TENSORS.keys()
    for name, array in TENSORS.items():
        np.testing.assert_array_equal(saved.tensors[name], array)
        assert saved.tensors[name].dtype == array.dtype
    assert sorted(path.name for path in folder.iterdir()) == [CONFIG_FILE, TENSOR_FILE]


@pytest.mark.parametrize("name", [CONFIG_FILE, TENSOR_FILE])
def test_a_missing_file_is_named(folder, name):
    (folder / name).unlink()
    with pytest.raises(FileFormatError, match=name):
        read_model(folder)


@pytest.mark.parametrize("name", [CONFIG_FILE, TENSOR_FILE])
def test_every_truncation_is_noticed(folder, name):
    content = (folder / name).read_bytes()
    # The very last byte of config.json is a line end that means nothing.
    for length in range(0, len(content) - 1, 7):
        (folder / name).write_bytes(content[:length])
        with pytest.raises(FileFormatError):
            read_model(folder)


@pytest.mark.parametrize("name", [CONFIG_FILE, TENSOR_FILE])
def test_every_flipped_bit_is_noticed_or_harmless(folder, name):
    content = (folder / name).read_bytes()
    intact = read_model(folder)
    rng = np.random.default_rng(0)
    for position in range(len(content)):
        damaged = bytearray(content)
        damaged[position] ^= 1 << int(rng.integers(8))
        (folder / name).write_bytes(damaged)
        try:
            saved = read_model(folder)
        except FileFormatError:
            continue
        # A flip in the white space between two words of JSON can leave white space.
        assert name == CONFIG_FILE
        assert saved.settings == intact.settings


def test_another_kind_of_file_is_refused(folder):
    (folder / CONFIG_FILE).write_text(json.dumps({"file_format": "something else", "version": 1}))
    with pytest.raises(FileFormatError, match="something else"):
        read_model(folder)


def test_another_generator_is_refused(folder):
    with pytest.raises(FileFormatError, match="load_generator"):
        read_model(folder, expected="diffusion")
    with pytest.raises(FileFormatError, match="known here"):
        load_generator(folder)


def test_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(FileFormatError, match="folder"):
        load_generator(tmp_path / "nowhere")
