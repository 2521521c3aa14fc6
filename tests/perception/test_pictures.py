"""Photographs of all kinds become RGB of 8 bits, upright."""

import io

import cv2
import numpy as np
import pytest
from PIL import Image

from prior_reinforce.errors import FileFormatError
from prior_reinforce.perception.pictures import read_picture, stored_turn


def saved(image, kind="PNG", **how):
    file = io.BytesIO()
    image.save(file, kind, **how)
    file.seek(0)
    return file


RAMP = np.linspace(0, 1, 64).reshape(8, 8)


@pytest.mark.parametrize("bits", [10, 12, 16])
def test_a_picture_of_more_than_eight_bits_keeps_its_shades(bits):
    deep = Image.fromarray((RAMP * (2**bits - 1)).astype(np.uint16))
    seen = read_picture(saved(deep))
    assert seen.dtype == np.uint8
    np.testing.assert_allclose(seen[..., 0], RAMP * 255, atol=1.5)
    assert (seen == seen[..., :1]).all()


@pytest.mark.parametrize("bits", [12, 16])
def test_a_picture_of_more_than_eight_bits_in_colour_is_brightened_too(bits):
    """Of 12 bits, which a camera stores in 16, Pillow reads 4."""
    blue = (RAMP * (2**bits - 1)).astype(np.uint16)
    _, content = cv2.imencode(".png", np.stack([blue, blue // 2, 0 * blue], axis=-1))
    seen = read_picture(io.BytesIO(content.tobytes())).astype(float)
    coarse = 255 / (2 ** (bits - 8) - 1)
    np.testing.assert_allclose(seen[..., 2], RAMP * 255, atol=coarse + 1)
    np.testing.assert_allclose(seen[..., 1], RAMP * 127, atol=coarse + 1)
    assert seen.max() == 255
    assert seen[..., 0].max() == 0


@pytest.mark.parametrize("mode", ["1", "L", "LA", "P", "RGB", "RGBA"])
def test_any_mode_becomes_three_colours(mode):
    seen = read_picture(saved(Image.new("RGB", (4, 2), "white").convert(mode)))
    assert seen.shape == (2, 4, 3)
    assert (seen == 255).all()


def test_a_picture_taken_upright_is_turned_upright():
    turned = Image.Exif()
    turned[0x0112] = 6
    file = saved(Image.new("RGB", (40, 20)), "JPEG", exif=turned)
    assert read_picture(file).shape[:2] == (40, 20)


@pytest.mark.parametrize(("written", "said"), [(None, 1), (1, 1), (3, 3), (8, 8), (0, 1), (77, 1)])
def test_how_a_picture_is_stored_is_told(tmp_path, written, said):
    exif = Image.Exif()
    if written is not None:
        exif[0x0112] = written
    Image.new("RGB", (40, 20)).save(tmp_path / "a.jpg", exif=exif)
    assert stored_turn(tmp_path / "a.jpg") == said


def test_what_is_none_is_named(tmp_path):
    (tmp_path / "a.png").write_text("x")
    with pytest.raises(FileFormatError, match=r"a\.png.*expected a PNG or JPEG"):
        read_picture(tmp_path / "a.png")


@pytest.mark.parametrize("mode", ["RGBA", "LA", "P"])
def test_what_is_transparent_has_no_colour(mode):
    """A quarter of such a picture shows; an editor leaves any colour behind the rest."""
    picture = Image.new("RGBA", (40, 40), (255, 120, 0, 0))
    picture.paste((0, 0, 255, 255), (0, 0, 20, 20))
    seen = read_picture(saved(picture.convert(mode)))
    assert (seen[20:, 20:] == 255).all()
    assert (seen[:20, :20] < 255).any()
