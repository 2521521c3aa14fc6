"""What others build on: the exported names, and how little the small commands load."""

import ast
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import prior_reinforce as pr
import prior_reinforce.testing

REPOSITORY = Path(__file__).parents[1]
PUBLIC = {"prior_reinforce": pr, "prior_reinforce.testing": prior_reinforce.testing}
HEAVY = {
    "torch",
    "mujoco",
    "mink",
    "matplotlib",
    "joblib",
    "imageio_ffmpeg",
    "openai",
    "scipy.interpolate",
    "scipy.special",
    "scipy.optimize",
    "scipy.spatial",
    "scipy.linalg",
    "sklearn",
    "pyarrow",
}


def shown_code():
    """Python that a reader is shown or can run: name, and source."""
    for path in [REPOSITORY / "README.md", *sorted(REPOSITORY.glob("docs/**/*.md"))]:
        blocks = re.findall(r"^```python.*?\n(.*?)^```$", path.read_text(), re.M | re.S)
        for number, block in enumerate(blocks):
            yield f"{path.relative_to(REPOSITORY)}, block {number}", block
    for path in sorted(REPOSITORY.glob("examples/*.py")):
        yield str(path.relative_to(REPOSITORY)), path.read_text()
    for folder in ("docs", "examples"):
        for path in sorted((REPOSITORY / folder).glob("**/*.ipynb")):
            cells = [c for c in json.loads(path.read_text())["cells"] if c["cell_type"] == "code"]
            code = "\n".join("".join(cell["source"]) for cell in cells)
            yield str(path.relative_to(REPOSITORY)), re.sub(r"^[%!].*$", "", code, flags=re.M)


CODE = dict(shown_code())


@pytest.mark.parametrize("module", PUBLIC.values(), ids=PUBLIC)
def test_every_exported_name_is_there(module):
    assert module.__all__
    assert len(set(module.__all__)) == len(module.__all__)
    for name in module.__all__:
        getattr(module, name)
    assert set(module.__all__) <= set(dir(module))


def test_a_name_that_is_not_exported_is_told():
    with pytest.raises(AttributeError, match="Sesion"):
        _ = pr.Sesion


@pytest.mark.parametrize("where", CODE)
def test_what_a_reader_is_shown_imports_public_names_only(where):
    """`import prior_reinforce as pr`, then any `pr.name`; or `from prior_reinforce import name`."""
    tree = ast.parse(CODE[where])
    aliases = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for name in node.names:
                if name.name.partition(".")[0] == "prior_reinforce":
                    assert name.name in PUBLIC, f"{where} imports {name.name}"
                    aliases[name.asname or name.name] = PUBLIC[name.name]
        if isinstance(node, ast.ImportFrom) and not node.level:
            module = node.module or ""
            if module.partition(".")[0] == "prior_reinforce":
                assert module in PUBLIC, f"{where} imports from {module}"
                for name in node.names:
                    assert name.name in PUBLIC[module].__all__, f"{where} imports {name.name}"
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            module = aliases.get(node.value.id)
            assert module is None or node.attr in module.__all__, f"{where}: {node.attr}"


@pytest.mark.slow
def test_small_commands_load_nothing_heavy(workspace):
    """They answer at once; importing torch alone takes longer than all that they do."""
    workspace.session().ask()
    workspace.close()
    commands = [["status"], ["tell", "1", "--error", "3cm long, 1cm left"], ["log"]]
    commands += [["goal", "0.95", "0.0"]]
    code = (
        "import json, sys; from prior_reinforce.cli import main\n"
        "for name, *rest in json.loads(sys.argv[2]):\n"
        "    status = main([name, sys.argv[1], *rest])\n"
        "    print(json.dumps([name, status, sorted(sys.modules)]), file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(workspace.folder), json.dumps(commands)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    told = [json.loads(line) for line in done.stderr.splitlines()]
    assert len(told) == len(commands)
    for name, status, loaded in told:
        assert status == 0, done.stdout
        assert HEAVY.isdisjoint(loaded), (name, sorted(HEAVY & set(loaded)))


# The types of what it is built on tell nothing of the loop, and torch and openai have very many.
CHECKED = f"""
[mypy]
strict = true
mypy_path = {Path(pr.__file__).parents[1]}
[mypy-h5py.*,httpx.*,matplotlib.*,mujoco.*,openai.*,pandas.*,PIL.*,pyarrow.*,rich.*,rosbags.*,scipy.*,sklearn.*,starlette.*,torch.*,tyro.*,zarr.*]
follow_imports = skip
"""


@pytest.mark.slow
def test_the_loop_of_the_readme_has_types(tmp_path):
    """A strict checker accepts what is copied first."""
    loop = next(code for name, code in CODE.items() if name.startswith("README"))
    (tmp_path / "mypy.ini").write_text(CHECKED)
    (tmp_path / "loop.py").write_text(loop)
    (tmp_path / "wrong.py").write_text(loop + "\nsession.ask().plan + ''\nsession.asks()\n")
    program = [sys.executable, "-m", "mypy", "loop.py", "wrong.py"]
    done = subprocess.run(program, capture_output=True, text=True, cwd=tmp_path)
    assert '"Session" has no attribute "asks"' in done.stdout
    assert "loop.py" not in done.stdout, done.stdout
