"""One standard term for one thing: words of the past do not come back."""

import subprocess
import sys

import pytest
from words import ROOMS, ROOT, files, hits


@pytest.mark.slow  # the linters do the same
def test_words_that_are_gone():
    assert len(files(ROOMS)) > 300
    lines = list(hits(ROOMS))
    assert not lines, "\n".join(lines[:50])


def test_the_script_fails_where_words_are_left(tmp_path):
    """It prints file, line, word and replacement; the linters call it without the package."""
    page = tmp_path / "page.md"
    script = [sys.executable, "-S", str(ROOT / "tests/shared/words.py")]
    for text, status in (("hat", 1), ("shape function", 0)):
        page.write_text(f"A linear\n{text}.\n")
        run = subprocess.run([*script, str(page)], capture_output=True, text=True)
        assert run.returncode == status, run.stderr
        assert ("page.md:2: 'hat': linear shape functions" in run.stdout) == bool(status)
