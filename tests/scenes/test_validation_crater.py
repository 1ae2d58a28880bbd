"""The depth of craters of falling balls: Uehara et al. (2003)."""

import numpy as np
import pytest

import granular as gr


@pytest.mark.slow
def test_depth_grows_with_the_cube_root_of_the_fall():
    """In 3D, a ball five cells across. The exponent is nearer to 1/3 than to the 1/4 of a crater
    of given shape and energy, or to the 1/2 of a depth in proportion to the speed.

    The law has the angle of repose, which a yield coefficient of 0.38 is at least. With the 24
    degrees of a heap of glass beads the law gives 15 % less.
    """
    drops, found = np.array([0.05, 0.2, 0.8]), []
    for drop in drops:
        scene = gr.scenes.sphere_drop(drop=drop, cell=0.005, duration=0.08)
        ball = gr.Simulation(scene).run(monitor=False).bodies[0]
        assert abs(ball.velocity[2]) < 0.01
        assert np.abs(ball.position[:2] - 0.08).max() < 1e-3
        found.append(scene.parameters["diameter"] / 2 - ball.position[2])
    depth = np.array(found)
    exponent = np.polyfit(np.log(drops + depth), np.log(depth), 1)[0]
    assert (1 / 4 + 1 / 3) / 2 < exponent < (1 / 3 + 1 / 2) / 2
    law = gr.theory.crater_depth(drops, 0.0254, scene.material.mu_s, 2200.0 / scene.material.rho_c)
    assert depth == pytest.approx(law, rel=0.2)
