"""Fixtures shared by all test folders: small scenes in every scheme that can be built."""

import os
import signal

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices of tests are small

import pytest
from schemes_by_name import scheme_of

import granular as gr
from granular import Box, Fill, Gravity, Grid, MuI, Solid, SpongeLayer, Wall

COMBINATIONS = [
    (basis, transfer, "particle")
    for basis in ("linear", "ugimp", "quadratic")
    for transfer in ("flip", "apic", "tpic", "xpic")
] + [("quadratic", "tpic", "smoothed"), ("linear", "tpic", "cell_averaged")]

CELL = 0.1


KINDS_OF_TESTS = ("unit", "verification", "validation", "robustness")


@pytest.hookimpl(tryfirst=True)  # before `-m` selects
def pytest_collection_modifyitems(items):
    """Mark each test with the kind that the name of its file begins with, as test_unit_*.py.

    Schemes that warn run in tests of every scheme; all other warnings are errors.
    """
    for item in items:
        kind = item.path.name.split("_")[1]
        if kind not in KINDS_OF_TESTS:
            raise pytest.UsageError(f"{item.path} must begin with test_ and {KINDS_OF_TESTS}")
        item.add_marker(kind)
        item.add_marker(pytest.mark.filterwarnings("ignore::granular.StabilityWarning"))


@pytest.fixture(scope="session", autouse=True)
def no_waiting_for_the_disk():
    """Let fsync return at once: what has reached the disk shows only after a loss of power.

    Tests that let calls of it fail replace it themselves; processes that tests start have the real
    one.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", os.fstat)  # which refuses what is no descriptor, too
        yield


@pytest.fixture
def ctrl_c():
    """Ctrl-C raises KeyboardInterrupt, here and in processes that the test starts.

    Processes started in the background (`nohup`, a batch system) ignore it, as do their children.
    """
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def module():
    """Module of the benchmarks, by its name."""
    from shared import module

    return module


@pytest.fixture(params=COMBINATIONS, ids="-".join)
def combination(request):
    """Choices that make up a scheme: (basis, transfer, density)."""
    return request.param


@pytest.fixture(
    params=[
        ("linear", "flip", "particle"),
        ("ugimp", "apic", "particle"),
        ("quadratic", "xpic", "particle"),
        ("quadratic", "tpic", "smoothed"),
        ("linear", "tpic", "cell_averaged"),
    ],
    ids="-".join,
)
def typical_combination(request):
    """Five of the combinations, among which each choice of each part occurs."""
    return request.param


@pytest.fixture(params=[2, 3])
def dim(request):
    """Dimension."""
    return request.param


def _walls(dim):
    """No-slip floor, Coulomb and free-slip sides, an inner wall, a sponge layer, a solid step."""
    last, up = dim - 1, 5 * CELL
    beside = ((0.0, 3 * CELL),) * (dim - 2)
    walls = [
        Wall(last, 0.0, kind="no_slip"),
        Wall(last, up, kind="free_slip"),
        Wall(0, 0.0, kind="free_slip"),
        Wall(0, 6 * CELL, kind="coulomb", friction=0.4),
        Wall(0, 3 * CELL, kind="free_slip", span=(*beside, (0.0, 2 * CELL))),
        Solid((5 * CELL,) + (0.0,) * last, (6 * CELL,) + (3 * CELL,) * (dim - 2) + (CELL,)),
    ]
    if dim == 3:
        walls += [Wall(1, 0.0, kind="no_slip"), Wall(1, 3 * CELL, kind="coulomb", friction=0.2)]
    top = (6 * CELL,) + (3 * CELL,) * (dim - 2) + (4 * CELL,)
    beside_step = Box((0.0,) * dim, (5 * CELL, *top[1:]))
    above_step = Box((5 * CELL, *(0.0,) * (dim - 2), CELL), top)
    grid = Grid((0.0,) * dim, CELL, (6, 3, 5) if dim == 3 else (6, 5))
    return {
        "grid": grid,
        "regions": (beside_step, above_step),
        "walls": walls,
        "sponge_layers": (SpongeLayer(last, 0.35, 200.0),),
    }


def _periodic(dim):
    """A layer on a no-slip floor, periodic along the other axes."""
    last = dim - 1
    shape = (*(4, 3, 5)[:last], 5)
    return {
        "grid": Grid(
            tuple(0.3 for _ in range(dim)), CELL, shape, periodic=(True,) * last + (False,)
        ),
        "regions": (Box((0.3,) * dim, (*(0.3 + CELL * n for n in shape[:last]), 0.3 + 4 * CELL)),),
        "walls": [Wall(last, 0.3, kind="no_slip")],
        "sponge_layers": (),
    }


def _outlet(dim):
    """A box with an opening in its floor, which opens at 0.05 s."""
    last = dim - 1
    shape = (*(6, 3, 6)[:last], 6)
    hole = ((0.0, 2 * CELL),) + ((0.0, 3 * CELL),) * (dim - 2)
    rest = ((2 * CELL, 6 * CELL),) + ((0.0, 3 * CELL),) * (dim - 2)
    walls = [
        Wall(last, 0.0, kind="no_slip", span=hole, opens_at=0.05),
        Wall(last, 0.0, kind="no_slip", span=rest),
    ]
    for axis in range(last):
        walls += [Wall(axis, 0.0, kind="free_slip")]
        walls += [Wall(axis, CELL * shape[axis], kind="free_slip")]
    return {
        "grid": Grid((0.0,) * dim, CELL, shape, open_sides=frozenset({"xyz"[last] + "-"})),
        "regions": (Box((0.0,) * dim, tuple(CELL * n for n in shape)),),
        "walls": walls,
        "sponge_layers": (),
    }


def _rings(first):
    """The same walls about an axis, or about a free-slip cylinder whose radius is `first` cells."""
    parts, low = _walls(2), first * CELL

    def moved(part, names):
        return part.replace(**{n: (getattr(part, n)[0] + low, getattr(part, n)[1]) for n in names})

    walls = []
    for wall in parts["walls"]:
        if isinstance(wall, Solid):
            walls.append(moved(wall, ("lower", "upper")))
        elif wall.axis:
            walls.append(wall)
        elif first or wall.at:  # no wall on the axis
            walls.append(wall.replace(at=wall.at + low))
    return parts | {
        "grid": Grid((low, 0.0), CELL, (6, 5), axisymmetric=True),
        "regions": tuple(moved(box, ("lower", "upper")) for box in parts["regions"]),
        "walls": walls,
    }


KINDS = {"walls": _walls, "periodic": _periodic, "outlet": _outlet}
OF_RINGS = {"axis": lambda dim: _rings(0), "rings": lambda dim: _rings(3)}  # in 2D only


def make_scene(kind, dim, combination, *, E=1e6, points_per_axis=2, jitter=1.0, **scheme):
    """Build a scene of a few dozen cells; `kind` is one of `KINDS` or `OF_RINGS`."""
    basis, transfer, density = combination
    parts = (KINDS | OF_RINGS)[kind](dim)
    side = (0.0,) if parts["grid"].axisymmetric else (1.5, 0.7)[: dim - 1]
    return gr.Scene(
        name=kind,
        grid=parts["grid"],
        fills=tuple(
            Fill(region, points_per_axis**dim, jitter=jitter) for region in parts["regions"]
        ),
        material=MuI(E=E),
        scheme=scheme_of(basis, transfer, density, **scheme),
        walls=tuple(parts["walls"]),
        sponge_layers=parts["sponge_layers"],
        gravity=Gravity((0.0, 0.1), ((*side, -4.0), (0.0,) * (dim - 1) + (-9.8,))),
        duration=1.0,
        seed=7,
    )


@pytest.fixture
def small_scene():
    """The function `make_scene`."""
    return make_scene
