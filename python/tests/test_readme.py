"""The Python code of the two READMEs, run as shown."""

import re
from pathlib import Path

import deepfusion
import pytest
from PIL import Image

PACKAGE = Path(__file__).parents[1]


def blocks(readme):
    found = re.findall(r"```python\n(.*?)```", readme.read_text(), re.DOTALL)
    assert found, f"{readme} shows no Python"
    return found


@pytest.mark.parametrize("readme", [PACKAGE / "README.md", PACKAGE.parent / "README.md"], ids=["package", "project"])
def test_the_code_it_shows_runs(readme, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    street = deepfusion.simulate("one-image", frames=1, seed=3, size=(1242, 375), scan_every=0)
    Image.fromarray(deepfusion.Dataset(street)[0].image).save("street.jpg")
    for shown in blocks(readme):
        # The training is shortened here.
        short = shown.replace('train("tiny",', 'train({"preset": "tiny", "steps": 2, "batch": 2},')
        assert short != shown or "train(" not in shown
        names = {}
        exec(compile(short, str(readme), "exec"), names)
        seen = names.get("seen") or names["prediction"]
        assert seen.depth.ndim == 2 and seen.depth.min() > 0
        xyz, rgb = names["xyz"], names["rgb"]
        assert len(xyz) == len(rgb) > 0 and xyz[:, 2].max() <= 40
        if "run" in names:
            assert names["run"].path.is_dir() and names["report"]["n"] == 1
