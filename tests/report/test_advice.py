"""The picture of what an adapter knows."""

import imageio.v3 as imageio
import numpy as np

from prior_reinforce.report.advice import draw_advice


def test_where_a_first_throw_hits_is_dark(tmp_path):
    grid = np.stack(np.meshgrid([0.8, 0.9, 1.0], [-0.2, 0.2], indexing="ij"), -1).reshape(-1, 2)
    pictures = []
    for p in (0.0, 1.0):
        path = draw_advice(
            tmp_path / f"{p}.png", grid, np.full(6, p), grid[:2], grid[3], grid[4],
            (("x", "y"), ("m", "m")),
        )  # fmt: skip
        pictures.append(imageio.imread(path)[..., :3].mean())
    assert pictures[0] > pictures[1] + 20
