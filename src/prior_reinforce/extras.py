"""Optional libraries: which extra installs each, and what a user is told where one is missing.

`pip install .` brings the method and the arm. What needs more imports it where it is used, and a
missing library becomes one line that names the extra. The package is on no index: who reads that
line has a clone.
"""

from __future__ import annotations

import importlib.util

from prior_reinforce.errors import MissingExtraError

EXTRA_OF = {
    "torch": "diffusion",
    "mujoco": "simulation",
    "mink": "simulation",
    "joblib": "simulation",
    "threadpoolctl": "simulation",
    "imageio_ffmpeg": "simulation",
    "openai": "vlm",
    "httpx": "vlm",
    "pyarrow": "lerobot",
    "rosbags": "ros",
    "h5py": "hdf5",
    "zarr": "zarr",
    "numcodecs": "zarr",
    "pylibfranka": "fr3",
    "rtde_control": "ur",
    "rtde_receive": "ur",
    "starlette": "console",
    "uvicorn": "console",
    "anyio": "console",
    "segno": "console",
    "cv2": "camera",
}
"""Library, as it is imported -> extra of `pyproject.toml`."""
ALONE = {"franka_sim": "franka-sim==1.1.7"}
"""Library -> what installs it with --no-deps, which no extra can say: it asks for old versions of
NumPy and MuJoCo, and works with those of now."""


def missing_extra(error: ImportError) -> MissingExtraError | None:
    """Return the error to raise for a failed import; None if no extra has the library."""
    library = (error.name or "").partition(".")[0]
    return _missing(library) if library in {*EXTRA_OF, *ALONE} else None


def check_installed(library: str) -> None:
    """Do nothing if a library of `EXTRA_OF` is installed; it is not imported for that.

    MissingExtraError if it is not.
    """
    if importlib.util.find_spec(library) is None:
        raise _missing(library)


def _missing(library: str) -> MissingExtraError:
    how = (
        f"install it with: pip install --no-deps {ALONE[library]}"
        if library in ALONE
        else f"in your clone of the repository: pip install -e '.[{EXTRA_OF[library]}]'"
    )
    return MissingExtraError(f"{library} is not installed; {how}")
