"""Every block of the documentation runs."""

import re
from pathlib import Path

import dioptric as dp
import pytest

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("page", ["docs/python.md", "docs/book/src/python.md", "crates/python/README.md"])
def test_page_runs(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    blocks = list(re.finditer(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL))
    assert blocks
    names: dict[str, object] = {}
    for block in blocks:
        # Lines in errors are those of the page.
        padded = "\n" * text[: block.start(1)].count("\n") + block[1]
        exec(compile(padded, page, "exec"), names)
    assert (tmp_path / "picture.png").exists()


def test_everything_is_documented() -> None:
    kinds = (dp.Camera, dp.Developed, dp.Lens, dp.LightField, dp.Rays, dp.Scene, dp.Sensor, dp.Shot, dp.Video, dp.VideoFrame, dp.World)
    for kind in kinds:
        assert kind.__doc__
        public = [name for name in vars(kind) if not name.startswith("_") and name != "FATES"]
        assert public
        for name in public:
            assert getattr(kind, name).__doc__, f"{kind.__name__}.{name}"
    for name in dp.measure.__all__:
        assert getattr(dp.measure, name).__doc__, name
