"""The code of docs/python.md runs, block after block, as one program; so do the examples."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "python" / "examples").glob("*.py"))


def run_in(directory, script):
    done = subprocess.run([sys.executable, "-W", "ignore::UserWarning", script], cwd=directory,
                          env={**os.environ, "MPLBACKEND": "Agg"}, text=True, capture_output=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_code_of_the_page_runs(tmp_path):
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "python.md").read_text(), re.S)
    assert len(blocks) >= 5
    program = "\n".join(blocks)
    # Processes that are spawned import the program again
    lines = ["def main():", *("    " + line for line in program.splitlines()),
             'if __name__ == "__main__":', "    main()"]
    (tmp_path / "page.py").write_text("\n".join(lines))
    run_in(tmp_path, tmp_path / "page.py")


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(tmp_path, example):
    pytest.importorskip("matplotlib", reason="matplotlib is missing: scripts/install-deps.sh")
    said = run_in(tmp_path, example)
    pictures = list(tmp_path.glob("*.png"))
    assert pictures and all(picture.stat().st_size > 5000 for picture in pictures)
    assert said


def test_there_are_four_examples():
    assert len(EXAMPLES) == 4
