"""Optional libraries: which extra installs each, and what a user is told where one is missing.

`pip install prior-reinforce` brings the method and the bench. What needs more imports it where it
is used, and a missing library becomes one line that names the extra.
"""

from __future__ import annotations

import importlib.util

from prior_reinforce.errors import MissingExtraError

EXTRA_OF = {
    "torch": "diffusion",
    "mujoco": "lab",
    "mink": "lab",
    "joblib": "lab",
    "threadpoolctl": "lab",
    "imageio_ffmpeg": "lab",
    "openai": "vlm",
    "movement_primitives": "baselines",
    "pytransform3d": "baselines",
    "botorch": "baselines",
    "cma": "baselines",
    "ray": "ray",
    "pyarrow": "lerobot",
    "rosbags": "ros",
    "h5py": "hdf5",
    "zarr": "zarr",
    "numcodecs": "zarr",
    "python_calamine": "excel",
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

    Raises:
        MissingExtraError: It is not.
    """
    if importlib.util.find_spec(library) is None:
        raise _missing(library)


def _missing(library: str) -> MissingExtraError:
    what = (
        f"--no-deps {ALONE[library]}"
        if library in ALONE
        else f"'prior-reinforce[{EXTRA_OF[library]}]'"
    )
    return MissingExtraError(f"{library} is not installed; install it with: pip install {what}")
