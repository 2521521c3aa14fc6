"""Which model looks: a file's section [vlm], a manifest's, or the default."""

import pytest

from prior_reinforce.commands.vision import model_of
from prior_reinforce.errors import ConfigurationError, FileFormatError
from prior_reinforce.perception.vlm_client import VisionLanguageModelConfig


def written(folder, text, name="vlm.toml"):
    (folder / name).write_text(text)
    return folder / name


def test_a_file_says_it_before_the_manifest_and_that_before_the_default(tmp_path):
    assert model_of(None) == VisionLanguageModelConfig()
    written(tmp_path, '[task]\nname = "a"\n', "workspace.toml")
    assert model_of(None, tmp_path) == VisionLanguageModelConfig()
    written(tmp_path, "[vlm]\nvotes = 1\n", "workspace.toml")
    assert model_of(None, tmp_path).votes == 1
    file = written(tmp_path, '[vlm]\nvotes = 5\nleave_out = ["temperature"]\n')
    assert model_of(file, tmp_path) == VisionLanguageModelConfig(
        votes=5, leave_out=("temperature",)
    )
    assert VisionLanguageModelConfig.load(str(file)).votes == 5


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('model = "a"\n', "no section \\[vlm\\]"),
        ("[vlm", "expected a TOML file"),
        ('[vlm]\nmodell = "a"\n', "no setting 'modell'"),
        ("[vlm]\nvotes = 0\n", "votes"),
        ('[vlm]\nfamily = "gpt"\n', "gpt"),
        ('[vlm]\nbase_url = "u:hunter@host"\n', "no address"),
    ],
)
def test_what_is_wrong_in_the_section_is_named_with_its_file(tmp_path, text, says):
    with pytest.raises((ConfigurationError, FileFormatError), match=says) as refused:
        model_of(written(tmp_path, text))
    assert "vlm.toml" in str(refused.value)
    assert "hunter" not in str(refused.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(FileFormatError, match=r"no\.toml"):
        model_of(tmp_path / "no.toml")
