"""Types that checkers and editors see of the numbers of a scheme."""

from pathlib import Path

import granular as gr
from granular.mpm import scheme_numbers


def test_the_stub_has_the_numbers_that_the_core_declares():
    lines = "\n".join(scheme_numbers.stub()) + "\n"
    stored = Path(scheme_numbers.__file__).with_suffix(".pyi")
    assert stored.read_text() == lines, "write the lines of scheme_numbers.stub() into it"
    for name in gr.Scheme().units:
        assert f"    {name}: " in lines
