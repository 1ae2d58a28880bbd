"""Owners of memory of the core or of open files, which cannot be copied."""

from __future__ import annotations

from typing import ClassVar, NoReturn


class Resource:
    """Base of objects whose copies would share something: `copy` and `pickle` raise TypeError."""

    _instead: ClassVar[str]
    """The way to another one of these, in words."""

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        raise TypeError(f"a {type(self).__name__} cannot be copied or pickled: {self._instead}")
