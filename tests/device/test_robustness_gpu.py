"""The way to a GPU by its driver, with a driver for tests whose GPU is the processor.

It runs csrc/gpu_kernels.c, the source of the kernels for GPUs, so that all but a real driver, and
the compiler that makes its text of them, is what a GPU has.
"""

import os
import re
import subprocess
import sys
import sysconfig
import textwrap
from pathlib import Path

import pytest
from oracle_fluidity import available

import granular as gr
from granular.run import machine

ROOT = Path(__file__).parents[2]
FOLDER = Path(__file__).parent
FLAGS = [
    "-fPIC",
    "-std=gnu11",
    "-O1",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-Wno-unused-function",
]
FLAGS += ["-DGR_ON_DEVICE", "-DGR_ONE_LANE", "-DGR_ISA=gpu", f"-I{ROOT}/csrc", f"-I{FOLDER}"]

BEGIN = """
    import os
    import sys
    import warnings

    sys.path.insert(0, {helpers!r})
    warnings.simplefilter("ignore")
    import granular as gr
    from granular.run import machine
    from same_bits import bits
    from scenes_by_hand import bed_with_bodies, sleeping_bed
    from schemes_by_name import scheme_of

    machine._kernels = lambda: (b"// .version 8.0", b"// .version 8.0")
"""
"""Beginning of a script: the build may lack kernels for GPUs, which this driver does not need."""


@pytest.fixture(scope="module")
def driver(tmp_path_factory):
    """Folder of the driver."""
    if "one_lane" not in available():
        pytest.skip("needs a fused multiply-add")
    folder = tmp_path_factory.mktemp("driver")
    compiler = sysconfig.get_config_var("CC").split()[0]
    fuses = ["-mavx2", "-mfma"] if "avx2" in available() else []
    kernels = [*FLAGS, *fuses, "-include", f"{FOLDER}/fake_driver.h", f"{ROOT}/csrc/gpu_kernels.c"]
    jobs = [
        subprocess.Popen([compiler, *kernels, "-c", "-o", f"{folder}/double.o"]),
        subprocess.Popen([compiler, *kernels, "-DGR_SINGLE", "-c", "-o", f"{folder}/single.o"]),
        subprocess.Popen(
            [compiler, *FLAGS, f"{FOLDER}/fake_driver.c", "-c", "-o", f"{folder}/driver.o"]
        ),
    ]
    assert not any(job.wait() for job in jobs)
    objects = [f"{folder}/{name}.o" for name in ("double", "single", "driver")]
    library = ["-shared", *objects, "-ldl", "-lm", "-o", f"{folder}/libcuda.so.1"]
    subprocess.run([compiler, *library], check=True)
    return folder


def said(driver, script, **faults):
    """Run a script that finds this driver; return its output."""
    place = {"LD_LIBRARY_PATH": str(driver)} if driver else {}
    environment = os.environ | place | {name: str(value) for name, value in faults.items()}
    begin = textwrap.dedent(BEGIN).format(helpers=str(ROOT / "tests/shared"))
    command = [sys.executable, "-c", begin + textwrap.dedent(script)]
    return subprocess.run(
        command, check=True, stdout=subprocess.PIPE, text=True, env=environment
    ).stdout


@pytest.mark.slow
def test_a_gpu_has_the_bits_of_a_processor(driver):
    """Both precisions, planes, rings, averages, XPIC, inflow, bodies, sleep, groupings."""
    script = """
        from functools import partial

        def slots(sim):
            sim._engine.regroup()
            return {name: array.tobytes() for name, array in sim.buffers.items()}

        def check(name, numbers, steps=80, **scheme):
            by_hand = {"bodies": bed_with_bodies, "sleep": sleeping_bed}
            scene = (by_hand.get(name) or gr.scenes.registry[name])(**numbers)
            scene = scene.replace(scheme=scene.scheme.replace(**scheme))
            alone = gr.Simulation(scene, threads=1, isa="one_lane")
            gpu = gr.Simulation(scene, device="gpu")
            alone.step(steps)
            gpu.step(steps // 2)
            resume = partial(gr.Simulation.from_checkpoint, scene, gpu.checkpoint())
            one, gpu = resume(threads=1, isa="one_lane"), resume(device="gpu")
            for sim in (one, gpu):
                sim.step(steps - steps // 2)
            assert bits(alone) == bits(one) == bits(gpu)
            assert slots(one) == slots(gpu)
            for sim in (one, gpu):
                sim.step(5)
            assert gpu._engine.foreign_array() is None
            print(name, bits(one) == bits(gpu))

        averaged = gr.mpm.schemes.cell_averaged
        for precision in ("double", "single"):
            check("column_collapse", {"cell": 0.05}, precision=precision)
            check("cylinder_collapse", {"cell": 0.1}, precision=precision)
        check("cylinder_collapse", {"cell": 0.05, "axisymmetric": True})
        check("column_collapse", {"cell": 0.05, "scheme": averaged})
        xpic = scheme_of("quadratic", "xpic", "particle")
        check("column_collapse", {"cell": 0.05, "scheme": xpic})
        check("silo_fed", {"cell": 0.02, "duration": 0.3})
        sand = gr.materials.NGF(E=1e5, d=0.02, A=0.5, t0=1e-2)
        for method in ("implicit", "rkl2"):
            way = gr.mpm.schemes.Fluidity(method=method, initial=0.5, substeps=2)
            check("column_collapse", {"cell": 0.05, "material": sand}, fluidity=way, dt=2e-4)
        check("chute_ngf", {"columns": 2}, 20)
        check("bodies", {"dim": 2, "thin": True})
        check("bodies", {"dim": 2, "thin": True}, precision="single", transfer="apic")
        check("bodies", {"dim": 2})
        check("bodies", {"dim": 2}, **averaged.arguments())
        smoothed = ("quadratic", "tpic", "smoothed")
        check("sleep", {"combination": smoothed, "height": 0.45, "top": 0.6}, 760)
    """
    lines = said(driver, script).splitlines()
    assert len(lines) == 16
    assert all(line.endswith("True") for line in lines), lines


@pytest.mark.slow
def test_threads_that_run_at_once_have_the_gpu_in_turns(driver):
    """Each launch is for the engine of its own thread."""
    script = """
        from concurrent.futures import ThreadPoolExecutor

        scenes = [gr.scenes.column_collapse(cell=cell) for cell in (0.05, 0.04)]

        def state(scene, **machine):
            sim = gr.Simulation(scene, **machine)
            sim.step(60)
            return bits(sim)

        with ThreadPoolExecutor(2) as pool:
            together = list(pool.map(lambda scene: state(scene, device="gpu"), scenes))
        print(together == [state(scene, threads=1, isa="one_lane") for scene in scenes])
    """
    assert said(driver, script) == "True\n"


REFUSED = """
    try:
        gr.Simulation(gr.scenes.column_collapse(cell=0.1), device="gpu")
    except (RuntimeError, ValueError) as error:
        print(error)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "why"),
    [
        ("none", "finds no GPU"),
        ("old_driver", "the driver is too old: it is of CUDA 11.4, must be of 12.0 or later"),
        ("old_gpu", "the GPU is too old: it has compute capability 6.0, must have 7.5"),
        ("windows", "no managed memory that a processor may use at the same time"),
        ("little_memory", "of memory, must be at most the 0.00074 GB that are available"),
    ],
)
def test_a_gpu_that_cannot_be_used_says_why(driver, fault, why):
    assert why in said(driver, REFUSED, FAKE_GPU=fault)


@pytest.mark.slow
@pytest.mark.parametrize("launches", [5, 302, 307, 1000])
def test_a_gpu_that_is_lost_is_said_and_the_record_goes_on(driver, launches, tmp_path):
    """The run ends in any stage of a step; a processor goes on from the last checkpoint."""
    script = f"""
        scene, path = gr.scenes.column_collapse(cell=0.05), {str(tmp_path / "run.h5")!r}
        gpu = gr.Simulation(scene, device="gpu")
        os.environ["FAKE_GPU"] = "lost"
        try:
            gpu.run(until=0.3, save=path, every=1e-3)
        except gr.SimulationError as error:
            print(error, error.step)
        sim = gr.Simulation.resume(path, threads=1)
        sim.run(until=0.01)
        alone = gr.Simulation(scene, threads=1, isa=sim.isa)
        alone.run(until=0.01, every=1e-3, save={str(tmp_path / "alone.h5")!r})
        print(bits(sim) == bits(alone))
    """
    lines = said(driver, script, FAKE_LAUNCHES=launches).splitlines()
    assert "the device has failed in step" in lines[0]
    assert "it was lost (error 719 of the driver)" in lines[0]
    assert lines[1] == "True"


@pytest.mark.slow
@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("launches", [0, 3, 8, 13, 20, 40, 60])
def test_a_gpu_that_is_lost_while_points_are_grouped_is_said(driver, launches, first):
    """They are grouped when a simulation is made, too."""
    script = f"""
        try:
            if {first}:
                os.environ["FAKE_GPU"] = "lost"
            sim = gr.Simulation(gr.scenes.column_collapse(cell=0.05), device="gpu")
            os.environ["FAKE_GPU"] = "lost"
            sim._engine.regroup()
            sim.step()
        except gr.SimulationError as error:
            print(error)
    """
    assert "the device has failed" in said(driver, script, FAKE_LAUNCHES=launches)


def test_the_kernels_for_gpus_are_whole():
    """No thread comes to a place that was left out, and each text has what the other lacks."""
    try:
        texts = [text.decode() for text in machine._kernels()]
    except RuntimeError:
        pytest.skip("built without kernels for GPUs")
    for text, other in (texts, texts[::-1]):
        assert not re.search(r"^\s*trap;", text, re.MULTILINE)
        lacking = re.findall(
            r"^\.extern \.(?:func|global)[^;]*?(\w+)(?:\[\d+\])?\s*[(;]", text, re.M
        )
        defined = re.findall(
            r"^\.visible \.(?:func|global)[^;{]*?(\w+)(?:\[\d+\])?\s*[(=;]", other, re.M
        )
        assert set(lacking) <= set(defined)
    assert ".extern" in texts[1]


def test_without_a_driver_there_is_no_gpu():
    """The argument and what is missing are named, also where the build has no kernels."""
    with pytest.raises(RuntimeError, match=r"device = 'gpu' cannot be used: .*(driver|kernels)"):
        gr.Simulation(gr.scenes.column_collapse(cell=0.1), device="gpu")
