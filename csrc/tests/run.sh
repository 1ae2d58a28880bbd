#!/usr/bin/env bash
# Build and run the C tests under the sanitizers: csrc/tests/run.sh [axis grid ...]
# CC: compiler (gcc). SANITIZE: the sanitizers (address,undefined,float-cast-overflow; thread), 0 for
# none. MACHINE=any: the baseline kernels alone. BUILD: folder of the objects, kept if given. JOBS:
# compilers and tests at a time.
set -euo pipefail
cd "$(dirname "$0")/../.."

CC=${CC:-gcc}
JOBS=${JOBS:-$(nproc)}
if [ -z "${BUILD:-}" ]; then
    BUILD=$(mktemp -d)
    trap 'rm -rf "$BUILD"' EXIT
fi
mkdir -p "$BUILD"

warnings="-Wall -Wextra -Wconversion -Wshadow -Werror"
flags="-std=gnu11 -g1 -O1 -ffp-contract=off -fno-math-errno -fno-trapping-math -Icsrc -pthread"
flags+=" -DGR_WITHOUT_ONE_LANE" # which is the same source
sanitize=${SANITIZE:-address,undefined,float-cast-overflow}
if [ "$sanitize" != 0 ]; then
    flags+=" -fsanitize=$sanitize -fno-sanitize-recover=all -fno-omit-frame-pointer"
    calls="--param asan-instrumentation-with-call-threshold=0" # checks by calls: compiles much faster
    if $CC $calls -E -x c /dev/null >/dev/null 2>&1; then flags+=" $calls"; fi
fi
kernels=(baseline:)
case ${MACHINE:-$(uname -m)} in
x86_64 | amd64 | i686)
    flags+=" -DGR_X86"
    avx2="-mavx2 -mfma"
    kernels+=("avx2:$avx2")
    if [ "$sanitize" = 0 ]; then
        kernels+=("avx512:$avx2 -mavx512f -mavx512dq -mavx512vl -mprefer-vector-width=512")
    else # the same source once more, whose sanitizers take minutes to compile
        flags+=" -DGR_WITHOUT_AVX512"
    fi
    ;;
esac

# The core is all that does not know Python; kernels.c includes the *.inl. With it, what all tests share.
core=(csrc/{core,law,fluidity,body,mpm,contact,engine,gpu,sph}/*.c csrc/dispatch.c csrc/tests/{check,scene,faults}.c)

tests=("$@")
if [ $# = 0 ]; then
    for source in csrc/tests/test_*.c; do
        source=${source##*/test_}
        tests+=("${source%.c}")
    done
fi

{ # the kernels first: they take longest
    for kernel in "${kernels[@]}"; do
        compile="$CC $warnings $flags ${kernel#*:} -DGR_ISA=${kernel%%:*} -c csrc/kernels.c -o $BUILD/kernels_${kernel%%:*}"
        echo "$compile.o"
        echo "${compile}_single.o -DGR_SINGLE"
    done
    for source in "${core[@]}"; do
        name=${source#csrc/}
        echo "$CC $warnings $flags -c $source -o $BUILD/${name//\//_}.o"
    done
    for test in "${tests[@]}"; do
        echo "$CC $warnings $flags -c csrc/tests/test_$test.c -o $BUILD/test_$test.o"
    done
} | xargs -P "$JOBS" -d '\n' -I{} sh -c '{}'

library=("$BUILD"/kernels_*.o)
for source in "${core[@]}"; do
    name=${source#csrc/}
    library+=("$BUILD/${name//\//_}.o")
done

link_and_run() { # test: what it prints and its status go to files
    local status=0
    # shellcheck disable=SC2086
    $CC $flags "$BUILD/test_$1.o" "${@:2}" -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc,--wrap=pthread_create -lm -o "$BUILD/$1" &&
        "$BUILD/$1" >"$BUILD/$1.log" || status=$?
    echo "$status" >"$BUILD/$1.status"
}
export -f link_and_run
export CC flags BUILD
export UBSAN_OPTIONS=print_stacktrace=1
rm -f "$BUILD"/*.log
printf '%s\n' "${tests[@]}" | xargs -P "$JOBS" -I{} bash -c 'link_and_run "$@"' bash {} "${library[@]}"

passed=0 failed=0
for test in "${tests[@]}"; do
    status=$(cat "$BUILD/$test.status")
    output=$(cat "$BUILD/$test.log" 2>/dev/null || true)
    echo "${output:-$test: ended with status $status}"
    if [[ $output =~ ([0-9]+)\ passed,\ ([0-9]+)\ failed$ ]]; then
        passed=$((passed + BASH_REMATCH[1])) failed=$((failed + BASH_REMATCH[2]))
        # a sanitizer that spoke at the end (a leak) is a failure of its own
        if [ "$status" != 0 ] && [ "${BASH_REMATCH[2]}" = 0 ]; then failed=$((failed + 1)); fi
    else
        failed=$((failed + 1))
    fi
done
echo "$passed passed, $failed failed"
[ "$failed" = 0 ]
