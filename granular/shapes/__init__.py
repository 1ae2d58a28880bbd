"""Shapes by signed distance, negative inside: solids, operations, meshes, height maps.

They are regions of fills and inflows, and the shapes of bodies.
"""

from granular.shapes.boxes import Box, HalfSpace
from granular.shapes.height_map import HeightMap
from granular.shapes.mesh import Mesh
from granular.shapes.mesh_surface import MeshWarning
from granular.shapes.operations import (
    Complement,
    Difference,
    Intersection,
    Offset,
    Shell,
    Union,
)
from granular.shapes.region import Region
from granular.shapes.round import Capsule, Cylinder, Frustum, Sphere, Torus
from granular.shapes.sections import Polygon, Prism, Revolve
from granular.shapes.shape import Shape

__all__ = [
    "Box",
    "Capsule",
    "Complement",
    "Cylinder",
    "Difference",
    "Frustum",
    "HalfSpace",
    "HeightMap",
    "Intersection",
    "Mesh",
    "MeshWarning",
    "Offset",
    "Polygon",
    "Prism",
    "Region",
    "Revolve",
    "Shape",
    "Shell",
    "Sphere",
    "Torus",
    "Union",
]
