"""The code of the pages runs as it stands there, in the folder of the repository."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
PAGES = ["README.md", "crates/groundcal-py/README.md", "docs/python.md"]


@pytest.mark.parametrize("page", PAGES)
def test_the_code_of_a_page_runs(page: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("cv2")
    monkeypatch.chdir(ROOT)
    text = (ROOT / page).read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)
    assert blocks
    known: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, page, "exec"), known)
    assert "calibration" in known
    if page != "crates/groundcal-py/README.md":
        return
    # What it prints is what the page says, but for digits.
    def letters(lines: str) -> str:
        return re.sub(r"[\d.-]+", "0", lines)

    printed = capsys.readouterr().out
    said = next(b for b in re.findall(r"^```text\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL) if "Calibration" in b)
    assert letters(said) in letters(printed)
    assert "no_common_plane" in printed and getattr(known["straight"], "shape") == (600, 800, 3)
