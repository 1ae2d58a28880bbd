"""Build of the extension granular._core; all metadata is in pyproject.toml.

The kernels are compiled once for each instruction set and chosen at run time: a wheel is portable.
Environment: GRANULAR_OPENMP = auto (default) | 1 | 0; GRANULAR_CFLAGS = extra compiler flags
(-g for a debugger: without it a wheel has a tenth of the size).
"""

import os
import sysconfig
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy
from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

ROOT = Path(__file__).parent
SOURCES = [
    str(path.relative_to(ROOT))
    for folder in ("core", "law", "fluidity", "body", "mpm", "sph", "python")
    for path in sorted((ROOT / "csrc" / folder).glob("*.c"))
]
SOURCES.append("csrc/dispatch.c")
# -ffp-contract=off: the bits must not depend on where a compiler chooses to fuse.
FLAGS = ["-std=gnu11", "-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"]
FLAGS += ["-fvisibility=hidden", "-g0"]  # -g0: flags of the interpreter often contain -g
KERNEL_FLAGS = ["-fno-tree-loop-distribute-patterns"]  # gcc: running sums are registers, no memset
AVX2 = ["-mavx2", "-mfma"]
AVX512 = [*AVX2, "-mavx512f", "-mavx512dq", "-mavx512vl", "-mprefer-vector-width=512"]
KERNELS = {"baseline": []}
# The platform that is built for: "macosx-11.0-arm64"; one of two processors has the baseline alone.
X86 = sysconfig.get_platform().rsplit("-", 1)[-1] in ("x86_64", "i686")
if X86:
    KERNELS |= {"avx2": AVX2, "avx512": AVX512}


class BuildCore(build_ext):
    """Compile kernels.c for each instruction set and link it with the rest."""

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

    def has_openmp(self) -> bool:
        wanted = os.environ.get("GRANULAR_OPENMP", "auto")
        if wanted not in ("auto", "0", "1"):
            raise SystemExit(f"GRANULAR_OPENMP = {wanted!r} must be auto, 0 or 1")
        if wanted == "0":
            return False
        source = "#include <omp.h>\nint main(void) { return !omp_get_max_threads(); }\n"
        found = self.accepts(["-fopenmp"], source)
        if wanted == "1" and not found:
            raise SystemExit("GRANULAR_OPENMP=1, but the compiler has no OpenMP")
        return found

    def build_extension(self, ext: Extension) -> None:
        flags = FLAGS + os.environ.get("GRANULAR_CFLAGS", "").split()
        if self.has_openmp():
            flags.append("-fopenmp")
            ext.extra_link_args.append("-fopenmp")
        if X86:
            ext.define_macros.append(("GR_X86", None))
        ext.define_macros.append(("GR_FLAGS", '"' + " ".join(flags) + '"'))
        ext.extra_compile_args += flags

        empty = "int main(void) { return 0; }\n"
        kernel_flags = flags + [flag for flag in KERNEL_FLAGS if self.accepts([flag], empty)]

        def compile_kernels(isa: str) -> list[str]:
            return self.compiler.compile(
                ["csrc/kernels.c"],
                output_dir=str(Path(self.build_temp, isa)),
                macros=[("GR_ISA", isa), *ext.define_macros],
                include_dirs=ext.include_dirs,
                extra_postargs=kernel_flags + KERNELS[isa],
                depends=ext.depends,
            )

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            for objects in pool.map(compile_kernels, KERNELS):
                ext.extra_objects += objects
        super().build_extension(ext)


setup(
    ext_modules=[
        Extension(
            "granular._core",
            sources=SOURCES,
            libraries=["m"],
            include_dirs=["csrc", numpy.get_include()],
            depends=[str(p.relative_to(ROOT)) for p in sorted((ROOT / "csrc").rglob("*.[chi]*"))],
        )
    ],
    cmdclass={"build_ext": BuildCore},
)
