"""Links from `gr.Name` in running text to the reference; unknown names are warnings."""

from __future__ import annotations

import inspect
import re
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.transforms.post_transforms import SphinxPostTransform
from sphinx.util import logging
from sphinx.util.nodes import make_refnode

NAME = re.compile(r"gr\.((?:\w+\.)*\w+)")
log = logging.getLogger(__name__)


def is_known(name: str) -> bool:
    """True if the package has an attribute of this dotted name."""
    import granular

    value: Any = granular
    for part in name.split("."):
        fields = getattr(value, "__dataclass_fields__", {})
        if not hasattr(value, part) and part not in fields:
            return False
        value = getattr(value, part, None)
    return True


def entries(name: str) -> list[str]:
    """Names under which the reference may have `gr.name`: its own, and where it is defined."""
    import granular

    names, value = [f"granular.{name}"], granular
    *parents, last = name.split(".")
    for part in parents:
        value = getattr(value, part, None)
    if inspect.isclass(value):
        names += [f"{kind.__module__}.{kind.__qualname__}.{last}" for kind in value.__mro__]
        names += [f"granular.{kind.__qualname__}.{last}" for kind in value.__mro__]
    found = getattr(value, last, None)
    module = getattr(found, "__module__", None) or ""
    if module.startswith("granular") and hasattr(found, "__qualname__"):
        names.append(f"{module}.{found.__qualname__}")
    return names


class LinkNames(SphinxPostTransform):
    """Make each `gr.Name` a link; arguments in brackets after it do not matter."""

    default_priority = 5

    def run(self, **_: Any) -> None:
        domain = self.env.get_domain("py")
        builder = self.app.builder
        for literal in list(self.document.findall(nodes.literal)):
            match = NAME.match(literal.astext())
            if not match or isinstance(literal.parent, nodes.reference):
                continue
            name = match[1].split("(")[0]
            entry = next(filter(None, map(domain.objects.get, entries(name))), None)
            if entry is not None:
                link = make_refnode(builder, self.env.docname, entry.docname, entry.node_id, [])
                literal.replace_self(link)
                link += literal
            elif not is_known(name):
                log.warning("the package has no gr.%s", name, location=literal)


def find(app: Sphinx, env: Any, node: nodes.Element, content: nodes.Node) -> nodes.Node | None:
    """Link of a name that a docstring writes from the top of the package, such as `measure.phase`.

    A name with a capital alone, such as `Trajectory`, refers to the first class of this name.
    """
    target = node.get("reftarget", "")
    if node.get("refdomain") != "py" or not target:
        return None
    objects = env.get_domain("py").objects
    names = [f"granular.{target.removeprefix('gr.')}"]
    if target[:1].isupper():
        names += sorted(name for name in objects if name.endswith(f".{target}"))
    for name in names:
        if name in objects:
            entry = objects[name]
            return make_refnode(
                app.builder, node["refdoc"], entry.docname, entry.node_id, content.deepcopy()
            )
    return None


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("missing-reference", find)
    app.add_post_transform(LinkNames)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
