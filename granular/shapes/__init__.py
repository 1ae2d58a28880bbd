"""Shapes by signed distance: solids, operations, meshes, height maps, and their measures."""
