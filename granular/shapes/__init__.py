"""Shapes by signed distance, negative inside: solids, operations, meshes, height maps.

They are regions of fills and inflows, and the shapes of bodies.
"""

from granular.shapes.boxes import Box as Box
from granular.shapes.boxes import HalfSpace as HalfSpace
from granular.shapes.height_map import HeightMap as HeightMap
from granular.shapes.mesh import Mesh as Mesh
from granular.shapes.mesh_surface import MeshWarning as MeshWarning
from granular.shapes.operations import Complement as Complement
from granular.shapes.operations import Difference as Difference
from granular.shapes.operations import Intersection as Intersection
from granular.shapes.operations import Offset as Offset
from granular.shapes.operations import Shell as Shell
from granular.shapes.operations import Union as Union
from granular.shapes.region import Region as Region
from granular.shapes.round import Capsule as Capsule
from granular.shapes.round import Cylinder as Cylinder
from granular.shapes.round import Frustum as Frustum
from granular.shapes.round import Sphere as Sphere
from granular.shapes.round import Torus as Torus
from granular.shapes.sections import Polygon as Polygon
from granular.shapes.sections import Prism as Prism
from granular.shapes.sections import Revolve as Revolve
from granular.shapes.shape import Shape as Shape
from granular.shapes.wheels import wheel as wheel
