"""Progress bars of runs and of other long work."""

from contextlib import AbstractContextManager, nullcontext
from typing import Any


class _Silent:
    """A progress bar without output."""

    n = 0.0

    def update(self, amount: float) -> None:
        self.n += amount


def bar(**options: Any) -> Any:
    """Progress bar of tqdm, as fits a terminal or a notebook."""
    from tqdm.auto import tqdm  # takes longer to import than all other libraries

    return tqdm(**options)


def progress_bar(
    name: str, time: float, until: float, visible: bool
) -> AbstractContextManager[Any]:
    """Progress bar of a run from a time to the time `until` [s], or one without output."""
    if not visible:
        return nullcontext(_Silent())
    form = "{l_bar}{bar}| {n:.3f}/{total:.3f} s [{elapsed}<{remaining}]"
    return bar(total=until, initial=time, desc=name, bar_format=form)
