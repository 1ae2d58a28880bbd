"""Memory of the points: buffers fit what the cells need, and grow as material spreads."""

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular.mpm import engine, simulation


@pytest.mark.parametrize(
    ("name", "bytes_a_point"),
    [("column_collapse", 240), ("silo_3d", 350)],  # 1.3 times the fields: 229 and 343
)
def test_buffers_are_little_larger_than_the_cells_need(name, bytes_a_point):
    sim = gr.Simulation(getattr(gr.scenes, name)(), threads=1)
    buffers = sim.buffers
    assert sum(array.nbytes for array in buffers.values()) < bytes_a_point * sim.n_points
    grouped = sim._engine.cells()[0].max() + 1
    assert buffers["id"].size - grouped < 0.15 * buffers["id"].size


def cloud(dim):
    """Points that fly apart into cells that were empty."""
    cell, n = 0.1, 40
    middle = 0.5 * n * cell
    boxes = [
        gr.Box((middle,) * dim, (middle + 2 * cell,) * dim),
        gr.Box((middle - 2 * cell,) * dim, (middle,) * dim),
    ]
    return scene_with(
        grid=gr.Grid((0.0,) * dim, cell, (n,) * dim),
        fills=tuple(
            gr.Fill(box, 4**dim, jitter=1.0, density=3e3, velocity=(side,) * dim)
            for box, side in zip(boxes, (9.0, -9.0), strict=True)
        ),
        gravity=0.0,
    )


@pytest.mark.parametrize("dim", [2, 3])
def test_buffers_that_grow_change_nothing(dim, monkeypatch):
    def run():
        sim = gr.Simulation(cloud(dim), threads=1)
        first = sim.buffers["id"].size
        sim.step(60)
        return sim, sim.buffers["id"].size / first

    small, growth = run()
    allocate = engine.allocate
    for module in (engine, simulation):
        monkeypatch.setattr(module, "allocate", lambda core, places: allocate(core, 100 * places))
    large, none = run()
    assert growth > 1.5
    assert none == 1
    one, other = small.checkpoint(), large.checkpoint()
    for name, array in one.arrays.items():
        np.testing.assert_array_equal(array, other.arrays[name])
