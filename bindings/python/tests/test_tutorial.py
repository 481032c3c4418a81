"""Runs the tutorial in docs/python.md."""

import os
import re
from pathlib import Path

TOUR = Path(__file__).resolve().parents[3] / "docs" / "python.md"


def test_the_tour_runs_as_it_stands(tmp_path, monkeypatch):
    blocks = re.findall(r"^```python\n(.*?)^```", TOUR.read_text(), re.M | re.S)
    assert len(blocks) == 9
    monkeypatch.chdir(tmp_path)
    names = {"TACTNET": os.environ.get("TACTNET", "tactnet"), "__name__": "tour"}
    try:
        for number, block in enumerate(blocks, 1):
            exec(compile(block, f"{TOUR.name}, block {number}", "exec"), names)
    finally:
        if "service" in names:
            names["service"].kill()
            names["service"].wait()
