"""Base of what describes a scene: parts that can be changed."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, Self


class Description:
    """Base of frozen dataclasses that are made anew to be changed."""

    def arguments(self) -> dict[str, Any]:
        """Arguments that make an equal object, floats to the last bit."""
        parts = fields(self)  # type: ignore[arg-type]  # subclasses are dataclasses
        return {part.name: getattr(self, part.name) for part in parts if part.init}

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some arguments changed; it is checked like a new object."""
        return type(self)(**(self.arguments() | changes))
