"""Damaged model folders are named errors, whatever was damaged."""

import json

import numpy as np
import pytest
from safetensors.numpy import save

from prior_reinforce.errors import FileFormatError
from prior_reinforce.files import sha256
from prior_reinforce.generators import SmoothInterpolation, load_generator
from prior_reinforce.generators.saving import (
    CONFIG_FILE,
    TENSOR_FILE,
    SavedLayer,
    read_model,
    write_model,
)

LAYERS = (
    SavedLayer("outer", 2, ("a remark",), {"gain": 0.1}, {"a.b": np.array([np.pi])}),
    SavedLayer("nothing", 2, (), {}),
    SavedLayer("inner", 2, (), {"widths": [1, 2]}, {"a": np.ones((2, 3), np.float32)}),
)


@pytest.fixture
def folder(tmp_path):
    write_model(tmp_path / "model", LAYERS)
    return tmp_path / "model"


def without_tensors(layers):
    return [(each.name, each.outcome_dim, each.remarks, each.settings) for each in layers]


def test_what_is_written_is_read(folder):
    read = read_model(folder)
    assert without_tensors(read) == without_tensors(LAYERS)
    for ours, theirs in zip(read, LAYERS, strict=True):
        assert ours.tensors.keys() == theirs.tensors.keys()
        for name, array in theirs.tensors.items():
            np.testing.assert_array_equal(ours.tensors[name], array)
            assert ours.tensors[name].dtype == array.dtype
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


@pytest.mark.slow
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
        assert without_tensors(saved) == without_tensors(intact)


def test_another_kind_of_file_is_refused(folder):
    (folder / CONFIG_FILE).write_text(json.dumps({"file_format": "something else", "version": 1}))
    with pytest.raises(FileFormatError, match="something else"):
        read_model(folder)


def crafted(folder, layers=None, tensors=None):
    """Change a model as somebody would who knows how its checksums are made."""
    config, weights = folder / CONFIG_FILE, folder / TENSOR_FILE
    content = json.loads(config.read_text())
    if layers is not None:
        content["layers"] = layers
    if tensors is not None:
        weights.write_bytes(save(tensors))
        content["tensors_sha256"] = sha256(weights.read_bytes())
    del content["config_sha256"]
    digest = sha256(json.dumps(content, sort_keys=True).encode())
    config.write_text(json.dumps({**content, "config_sha256": digest}))


LAYER = {"name": "interpolation", "outcome_dim": 2, "remarks": [], "settings": {}}


@pytest.mark.parametrize(
    "layers",
    [
        [],
        {},
        [1],
        [{**LAYER, "outcome_dim": 0}],
        [{**LAYER, "settings": None}],
        [{"name": "interpolation"}],
    ],
)
def test_a_stack_of_another_form_is_refused(folder, layers):
    crafted(folder, layers)
    with pytest.raises(FileFormatError, match=CONFIG_FILE):
        read_model(folder)


@pytest.mark.slow
@pytest.mark.parametrize("key", ["3.a", "-9.a", "a", "", "0x1.a", "1e0.a"])
def test_a_tensor_of_no_layer_is_refused(folder, key):
    crafted(folder, tensors={key: np.zeros(2)})
    with pytest.raises(FileFormatError, match=TENSOR_FILE):
        read_model(folder)


@pytest.mark.slow
@pytest.mark.parametrize(
    "names", [["interpolation", "interpolation"], ["timed"], ["timed"] * 5000, ["auto"]]
)
def test_a_stack_that_nobody_wrapped_is_refused(folder, names):
    crafted(folder, [{**LAYER, "name": name} for name in names], tensors={})
    with pytest.raises(FileFormatError):
        load_generator(folder)


def test_another_generator_is_refused(folder):
    with pytest.raises(FileFormatError, match=r"outer generator, not interp.*load_generator"):
        SmoothInterpolation.load(folder)
    with pytest.raises(FileFormatError, match="no generator 'inner'; known are auto, "):
        load_generator(folder)


def test_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(FileFormatError, match="folder"):
        load_generator(tmp_path / "nowhere")
