"""One scene run in several ways, with the same bits."""

import granular as gr


def bits(sim):
    """All data that a restart needs, as bytes."""
    point = sim.checkpoint()
    return point.scalars, {name: array.tobytes() for name, array in point.arrays.items()}


def fields(state):
    """The fields of a state, or of a part of it, as bytes."""
    return {name: array.tobytes() for name, array in state.fields.items()}


def shown(state):
    """Time, step, step size and fields of a state, as bytes."""
    return state.time, state.step, state.dt, fields(state)


def stepped(scene, *steps, threads=1):
    """A simulation after these numbers of steps, each in a call of its own."""
    sim = gr.Simulation(scene, threads=threads)
    for n in steps:
        sim.step(n)
    return sim


def same_bits(scene, first, then, threads=(2, 3), path=None):
    """The run by one thread, which is repeated by several, with others after a restart.

    The restart is from a checkpoint in memory, or from a record at `path`.
    """
    one = stepped(scene, first + then)
    part = stepped(scene, first, threads=threads[0])
    if path is None:
        resumed = gr.Simulation.from_checkpoint(scene, part.checkpoint(), threads=threads[-1])
    else:
        part.run(until=part.time, save=path)
        resumed = gr.Simulation.resume(path, threads=threads[-1])
    resumed.step(then)
    assert bits(resumed) == bits(one)
    return one
