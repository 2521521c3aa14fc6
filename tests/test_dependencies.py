"""Libraries: no older ones than could run code from data, and no call that would."""

import re
import sys
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.version import Version

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

REPOSITORY = Path(__file__).parents[1]
PROJECT, *BESIDE = (
    tomllib.loads((REPOSITORY / place / "pyproject.toml").read_text())["project"]
    for place in (".", "reproduction", "simulators")
)
REQUIRED = [
    Requirement(line)
    for project in (PROJECT, *BESIDE)
    for lines in (project["dependencies"], *project.get("optional-dependencies", {}).values())
    for line in lines
    if not line.startswith(PROJECT["name"])
]
SAFE_FROM = {
    "pyarrow": "14.0.1",  # CVE-2023-47248: code from Parquet and IPC files
    "pillow": "10.3.0",  # CVE-2023-50447 (code), CVE-2024-28219 (overflow)
    "joblib": "1.2.0",  # CVE-2022-21797: eval of an argument
    "numpy": "1.16.3",  # CVE-2019-6446: pickles of .npy files were read by default
    "h5py": "3.10",  # wheels with HDF5 1.14, after the overflows of 1.12
    "jinja2": "3.1.3",  # CVE-2024-22195: attributes that escape
    "safetensors": "0.4",  # the format is no pickle at all
    "ray": "2.8.1",  # CVE-2023-6019: commands through the dashboard
}
"""The first release without a known way to run code from what we let it read."""
RUNS_CODE = {
    "allow_pickle=True": r"allow_pickle\s*=\s*True",
    "torch.load": r"torch\.load\(",
    "pickle": r"\bpickle\.loads?\(|^import pickle|^from pickle",
    "joblib.load": r"joblib\.load\(",
    "yaml": r"yaml\.(unsafe_)?load\(",
    "eval": r"(?<![.\w])eval\(",
    "exec": r"(?<![.\w])exec\(",
    "a shell": r"shell\s*=\s*True|os\.system\(|os\.popen\(",
}


@pytest.mark.parametrize("name", sorted(SAFE_FROM))
def test_no_older_library_is_allowed_than_is_safe(name):
    for requirement in REQUIRED:
        if requirement.name.lower() == name:
            floors = [s.version for s in requirement.specifier if s.operator in (">=", "==")]
            assert floors, f"{name} has no floor"
            assert all(Version(floor) >= Version(SAFE_FROM[name]) for floor in floors)


def test_every_library_has_a_floor():
    bare = [str(r) for r in REQUIRED if not any(s.operator in (">=", "==") for s in r.specifier)]
    assert not bare


def test_what_is_installed_is_above_its_floor():
    pins = (REPOSITORY / "constraints.txt").read_text().splitlines()
    pinned = [Requirement(line) for line in pins if line and not line.startswith("#")]
    for pin in pinned:
        (version,) = (s.version for s in pin.specifier)
        for requirement in REQUIRED:
            if requirement.name.lower() == pin.name.lower():
                assert requirement.specifier.contains(version), (str(pin), str(requirement))


@pytest.mark.slow
@pytest.mark.parametrize("what", sorted(RUNS_CODE))
def test_nothing_is_called_that_runs_code_from_data(what):
    pattern = re.compile(RUNS_CODE[what], re.MULTILINE)
    paths = [*REPOSITORY.glob("src/**/*.py"), *REPOSITORY.glob("*/src/**/*.py")]
    found = [str(path) for path in paths if pattern.search(path.read_text())]
    assert not found
