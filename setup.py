"""Build of the extension granular._core; all metadata is in pyproject.toml.

The kernels are compiled once for each instruction set and chosen at run time: a wheel is portable.
Environment: GRANULAR_CFLAGS = extra compiler flags (-g for a debugger: without it a wheel has a
tenth of the size); GRANULAR_GPU = 1 to compile the kernels for GPUs, too, which takes clang 17 or
later, 0 not to, and by default where there is such a clang.
"""

import gzip
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from pathlib import Path

import numpy
from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist
from setuptools.modified import newer_group

ROOT = Path(__file__).parent
SOURCES = [
    str(path.relative_to(ROOT))
    for folder in (
        "core",
        "law",
        "fluidity",
        "body",
        "mpm",
        "contact",
        "engine",
        "gpu",
        "sph",
        "python",
    )
    for path in sorted((ROOT / "csrc" / folder).glob("*.c"))
]
SOURCES.append("csrc/dispatch.c")
# -ffp-contract=off: the bits must not depend on where a compiler chooses to fuse.
FLAGS = ["-std=gnu11", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"]
FLAGS += [
    "-pthread",
    "-fvisibility=hidden",
    "-g0",
]  # -g0: flags of the interpreter often contain -g
KERNEL_FLAGS = ["-fno-tree-loop-distribute-patterns"]  # gcc: running sums are registers, no memset
AVX2 = ["-mavx2", "-mfma"]
AVX512 = [*AVX2, "-mavx512f", "-mavx512dq", "-mavx512vl", "-mprefer-vector-width=512"]
# One lane is the form for a device; on a processor it serves to compare bits, and need not be fast.
ONE_LANE = ["-DGR_ONE_LANE", "-O2"]
KERNELS = {"baseline": []}
# The platform that is built for: "macosx-11.0-arm64"; one of two processors has the baseline alone.
X86 = sysconfig.get_platform().rsplit("-", 1)[-1] in ("x86_64", "i686")
if X86:
    KERNELS |= {"avx2": AVX2, "avx512": AVX512}
KERNELS["one_lane"] = [*AVX2, *ONE_LANE] if X86 else ONE_LANE
EMPTY = "int main(void) { return 0; }\n"
# PTX, the text that the driver of a GPU compiles: for compute capability 7.5 and later. Compilers
# name the newest version of PTX that they know, and drivers refuse one that is newer than theirs.
# What is here of the language is in version 8.0, of CUDA 12.0.
OLDEST_CLANG, PTX = 17, ".version 8.0"
GPU = ["--target=nvptx64-nvidia-cuda", "-march=sm_75", "-S", "-o", "-", "-std=gnu11", "-O2"]
GPU += [
    "-ffreestanding",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-nostdinc",
    "-Wno-unused-function",
]
GPU += ["-DGR_ON_DEVICE", "-DGR_ONE_LANE", "-DGR_ISA=gpu", "-Icsrc", "-isystem", "csrc/gpu/libc"]


def clang() -> str | None:
    """Path of a clang that compiles for GPUs; None without one."""
    names = [f"clang-{version}" for version in range(30, OLDEST_CLANG - 1, -1)]
    for path in filter(None, map(shutil.which, [*names, "clang"])):
        said = subprocess.run([path, "--version"], capture_output=True, text=True).stdout
        version = re.search(r"clang version (\d+)", said)
        if version and int(version[1]) >= OLDEST_CLANG:
            return path
    return None


def compile_for_gpus(folder: Path) -> None:
    """Write the kernels for GPUs, in both precisions, where granular/run/machine.py looks."""
    wanted, compiler = os.environ.get("GRANULAR_GPU", "auto"), clang()
    if wanted not in ("auto", "0", "1"):
        raise ValueError(f"GRANULAR_GPU = {wanted} must be auto, 0 or 1")
    if wanted == "1" and compiler is None:
        raise RuntimeError(
            f"GRANULAR_GPU = 1 takes clang {OLDEST_CLANG} or later, which is not there"
        )
    for precision, macro in (("double", []), ("single", ["-DGR_SINGLE"])):
        text = Path(folder, f"gpu_{precision}.ptx.gz")
        text.unlink(missing_ok=True)
        if wanted == "0" or compiler is None:
            continue
        headers = subprocess.run([compiler, "-print-resource-dir"], capture_output=True, text=True)
        own = ["-isystem", f"{headers.stdout.strip()}/include"]
        command = [compiler, *GPU, *own, *macro, "csrc/gpu_kernels.c"]
        done = subprocess.run(command, capture_output=True, text=True)
        if not done.returncode:
            code = re.sub(r"^\.version .*$", PTX, done.stdout, flags=re.MULTILINE)
            text.write_bytes(gzip.compress(code.encode(), mtime=0))
        elif wanted == "1":
            raise RuntimeError(f"the kernels for GPUs do not compile:\n{done.stderr}")


class BuildCore(build_ext):
    """Compile kernels.c for each instruction set and precision and link it with the rest."""

    def accepts(self, flags: list[str], source: str) -> bool:
        """True if the compiler makes a program with these flags."""
        with tempfile.TemporaryDirectory() as folder:
            probe = Path(folder, "probe.c")
            probe.write_text(source)
            flags = [*flags, "-Werror"]
            try:
                objects = self.compiler.compile(
                    [str(probe)], output_dir=folder, extra_postargs=flags
                )
                self.compiler.link_executable(
                    objects, str(Path(folder, "probe")), extra_postargs=flags
                )
            except Exception:
                return False
        return True

    def compile_all(self, ext: Extension, flags: list[str]) -> list[str]:
        """Object files of the kernels and of the other sources, several compilers at a time."""
        kernel_flags = flags + [flag for flag in KERNEL_FLAGS if self.accepts([flag], EMPTY)]
        # The kernels first, widest vectors before: they take longest.
        jobs = [
            (
                "csrc/kernels.c",
                Path(self.build_temp, isa + precision),
                [("GR_ISA", isa), *macro],
                kernel_flags + wide,
            )
            for isa, wide in reversed(KERNELS.items())
            for precision, macro in (("", []), ("_single", [("GR_SINGLE", None)]))
        ]
        jobs += [(source, Path(self.build_temp), [], flags) for source in ext.sources]

        def compile_one(job: tuple) -> list[str]:
            source, folder, macros, options = job
            return self.compiler.compile(
                [source],
                output_dir=str(folder),
                macros=[*macros, *ext.define_macros],
                include_dirs=ext.include_dirs,
                extra_postargs=options,
            )

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            return [name for objects in pool.map(compile_one, jobs) for name in objects]

    def copy_extensions_to_source(self) -> None:
        """Copy what was built next to the modules, for an editable installation."""
        super().copy_extensions_to_source()
        for text in Path(self.build_lib, "granular").glob("gpu_*.ptx.gz"):
            shutil.copy(text, ROOT / "granular")

    def build_extension(self, ext: Extension) -> None:
        flags = FLAGS + os.environ.get("GRANULAR_CFLAGS", "").split()
        if X86:
            ext.define_macros.append(("GR_X86", None))
        ext.define_macros.append(("GR_FLAGS", '"' + " ".join(flags) + '"'))

        # A core of the same sources, made in the same way, stays: `pip install .` again is quick.
        core = self.get_ext_fullpath(ext.name)
        compilers = [*self.compiler.compiler_so, *self.compiler.linker_so]
        gpu = os.environ.get("GRANULAR_GPU", "auto")
        made = " ".join([core, *compilers, *flags, "numpy", numpy.__version__, gpu, clang() or ""])
        record = Path(self.build_temp, "made.txt")
        same = record.exists() and record.read_text() == made
        if same and not self.force and not newer_group(ext.depends, core):
            return
        record.unlink(missing_ok=True)
        compile_for_gpus(Path(core).parent)
        linked = copy(ext)
        linked.extra_objects = self.compile_all(ext, flags)
        linked.sources = []
        self.force = True
        super().build_extension(linked)
        record.write_text(made)


def store_commit(folder: str) -> None:
    """Write the commit of the checkout, if this is one, for granular/tools/version.py."""
    if not (ROOT / ".git").exists():
        return
    command = ["git", "-C", str(ROOT), "rev-parse", "--short=8", "HEAD"]
    try:
        head = subprocess.run(command, capture_output=True, text=True).stdout
    except OSError:  # no git
        return
    Path(folder, "granular", "commit.txt").write_text(head)


class BuildPython(build_py):
    """Copy the modules and store the commit."""

    def run(self) -> None:
        super().run()
        if not self.editable_mode:
            store_commit(self.build_lib)


class SourceArchive(sdist):
    """Archive the sources and store the commit."""

    def make_release_tree(self, base_dir: str, files: list[str]) -> None:
        super().make_release_tree(base_dir, files)
        store_commit(base_dir)


setup(
    ext_modules=[
        Extension(
            "granular._core",
            sources=SOURCES,
            libraries=["m", "dl"] if sys.platform == "linux" else ["m"],
            extra_link_args=["-pthread"],
            include_dirs=["csrc", numpy.get_include()],
            depends=[
                "setup.py",
                *(str(p.relative_to(ROOT)) for p in sorted((ROOT / "csrc").rglob("*.[chi]*"))),
            ],
        )
    ],
    cmdclass={"build_ext": BuildCore, "build_py": BuildPython, "sdist": SourceArchive},
)
