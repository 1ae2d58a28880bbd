"""Numbers of any size in every description: they work, or are refused by name and range."""

import dataclasses
import warnings

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular import Solid, SpongeLayer, Wall, materials, shapes
from granular.tools.serializable import arguments_of

SIZES = (1e-300, 1e-30, 1e-8, 1e30, 1e300)
MADE_OF = ("duration", "points", "rate", "alpha", "E is too small", "strength", "xi")
FLOOR = {"walls": (Wall(1, 0.0),)}


def scene_of(material, **parts):
    fill = gr.Fill(gr.Box((0.0, 0.0), (0.5, 0.4)), 4, velocity=(0.1, 0.0))
    return scene_with(
        grid=gr.Grid((0.0, 0.0), 0.1, (16, 12)),
        gravity=gr.Gravity((0.0, 0.1), ((0.0, -1.0), (0.0, -9.8))),
        material=material,
        **{"fills": (fill,)} | parts,
    )


def everything():
    """A scene of nearly everything that a scene may have."""
    moving = gr.Motion(
        times=(0.0, 0.1), velocity=((0.1, 0.1), (0.2, 0.2)), angular_velocity=(0.1, 0.2)
    )
    block = gr.Body(
        shapes.Box(size=(0.3, 0.3)),
        (1.0, 0.8),
        mass=100.0,
        inertia=3.0,
        free="xy",
        friction=0.3,
        rotation_deg=10.0,
        restitution=0.2,
        motion=moving,
    )
    return scene_of(
        gr.MuI(E=1e6, cohesion=10.0, restitution=0.5, contact_diameter=0.01),
        walls=(
            Wall(1, 0.0, kind="coulomb", friction=0.4),
            Wall(0, 0.0, velocity=(0.0, 0.1)),
            Wall(0, 0.8, span=((0.3, 0.9),), opens_at=0.1),
            Solid((1.2, 0.0), (1.6, 0.3)),
        ),
        bodies=(block, gr.Body(shapes.Cylinder(0.2, center=(0.0, 0.0)), (0.5, 1.0), friction=0.2)),
        inflows=(gr.Inflow(gr.Box((1.2, 0.9), (1.5, 1.1)), (0.0, -0.3), 4, rate=100.0),),
        sponge_layers=(SpongeLayer(1, 1.1, damping=10.0),),
    )


SCENES = {
    "everything": everything(),
    "lithostatic": scene_of(
        gr.MuI(E=1e6),
        fills=(gr.Fill(gr.Sphere(0.3, center=(0.5, 0.5)), 4, lithostatic=True, jitter=0.3),),
    ),
    "NGF": scene_of(gr.NGF(E=1e6), **FLOOR),
    "DruckerPrager": scene_of(gr.DruckerPrager(E=1e6, cohesion=10.0), **FLOOR),
    "Hardening": scene_of(materials.HardeningDruckerPrager(E=1e6), **FLOOR),
    "RegularisedMuI": scene_of(materials.RegularisedMuI(E=1e6), **FLOOR),
    "Elastic": scene_of(materials.Elastic(E=1e6, restitution=0.5, contact_diameter=0.01), **FLOOR),
}


def places(part, path=()):
    """Paths of all numbers of a description."""
    if isinstance(part, float):
        yield path
    elif isinstance(part, tuple):
        for i, inner in enumerate(part):
            yield from places(inner, (*path, i))
    elif dataclasses.is_dataclass(part):
        for name, value in arguments_of(part).items():
            if name not in ("xi", "I0", "b"):
                yield from places(value, (*path, name))


def put(part, path, value):
    """A copy of a description with another number at a path."""
    if not path:
        return value
    first, *rest = path
    if isinstance(part, tuple):
        return tuple(put(x, rest, value) if i == first else x for i, x in enumerate(part))
    changed = {first: put(getattr(part, first), rest, value)}
    return type(part)(**(arguments_of(part) | changed))


@pytest.mark.parametrize("name", SCENES)
def test_numbers_of_any_size(name):
    """No other exception, no NumPy warning; a run may end by an error that names the point.

    What is refused is named, or the number that is made of it: points and memory of an inflow, the
    step that a duration is too long for, the motion of a body.
    """
    common = (
        set(places(SCENES["DruckerPrager"])) if name not in ("everything", "DruckerPrager") else ()
    )
    for path in places(SCENES[name]):
        if path[0] != "material" and path in common:
            continue
        *_, last = (part for part in path if isinstance(part, str))
        for size in SIZES[::3] if name == "everything" else SIZES:  # of the many the ends
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error", RuntimeWarning)
                    scene = put(SCENES[name], path, size)
                    gr.scene_warnings(scene)
                    gr.economy.cost(scene)
                    gr.Simulation(scene, threads=1).step(1)
            except ValueError as error:
                said = str(error)
                assert any(word in said for word in (last, path[0], *MADE_OF)), (path, size, said)
            except gr.SimulationError as error:
                assert np.isfinite(error.step)


def test_friction_and_inertia_of_any_size():
    for mu in (1e-30, 1e-8, 1e30):
        gr.Simulation(scene_of(gr.DruckerPrager(mu=mu, E=1e6)), threads=1).step(1)
    shape = shapes.Box(size=(0.3, 0.3))
    with pytest.raises(ValueError, match="inertia = 1e-300 must be at least 1e-30"):
        gr.Body(shape, (1.0, 0.8), mass=1.0, free="xy", inertia=1e-300)
    body = gr.Body(shape, (1.0, 0.8), mass=1.0, free="xy", inertia=1e-12)
    said = gr.scene_warnings(scene_of(gr.MuI(E=1e6), bodies=(body,)))
    assert said[-1].startswith("bodies[0].inertia = 1e-12 kg m2 is impossible for a body of 1 kg")
