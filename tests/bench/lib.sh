# lib.sh -- what the scripts that reconstruct and compare share; sourced. Needs $build.

data=${UNBAKE_TEST_DATA:-../shared/data}

# reconstruct ROOM OUT [name=value ...]: into the folder OUT; what it prints goes to OUT.log.
reconstruct() {
    local room=$1 out=$2
    shift 2
    rm -rf "$out" "$out.evaluation.json"
    mkdir -p "$out"
    "$build/tests/bench/reconstruct_room" "$room" "$out" "$@" >"$out.log" 2>&1 && return
    tail -n 3 "$out.log" >&2
    return 1
}

# working_sec OUT: seconds of all stages but the report.
working_sec() {
    jq '[.stages[] | select(.name != "report") | .seconds] | add' "$1/report.json" 2>/dev/null || echo null
}

# evaluate ROOM OUT [option ...]: compares with the truth, into OUT.evaluation.json.
evaluate() {
    local room=$1 out=$2
    shift 2
    "$build/unbaked" evaluate "$room" "$out" --json "$@" >"$out.evaluation.json"
}

# figure OUT NAME: of the comparison; "null" where there is none.
figure() {
    local value
    value=$(jq ".$2" "$1.evaluation.json" 2>/dev/null)
    echo "${value:-null}"
}

# at_least A B: whether A is a number and not below B.
at_least() {
    awk -v a="$1" -v b="$2" 'BEGIN { exit !(a != "null" && a + 0 >= b + 0) }'
}

# quotient A B: "null" where either is no number or B is 0.
quotient() {
    awk -v a="$1" -v b="$2" 'BEGIN { if (a == "null" || b == "null" || b + 0 == 0) print "null"; else print a / b }'
}

# Takes Mitsuba 3 from PyPI into $build/mitsuba, unless it is there; false where it is not to be had.
mitsuba_ready() {
    local llvm
    llvm=$(ls /usr/lib/*/libLLVM.so.19* /usr/lib/*/libLLVM-19.so* 2>/dev/null | head -n 1)
    if [ -z "$llvm" ]; then
        echo "no libllvm19" >&2
        return 1
    fi
    export DRJIT_LIBLLVM_PATH=$llvm
    [ -x "$build/mitsuba/bin/python" ] || python3 -m venv "$build/mitsuba" >&2 || return 1
    "$build/mitsuba/bin/python" -c 'import mitsuba, numpy' 2>/dev/null ||
        "$build/mitsuba/bin/pip" install -q mitsuba numpy >&2 || {
        echo "Mitsuba 3 cannot be installed" >&2
        return 1
    }
}

# Sets python to one that has numpy, OpenEXR and pillow, from PyPI in $build/retinex; false where they are not to be had.
picture_python() {
    python=$build/retinex/bin/python
    [ -x "$python" ] || python3 -m venv "$build/retinex" >&2
    "$python" -c 'import numpy, OpenEXR, PIL' 2>/dev/null ||
        timeout 300 "$build/retinex/bin/pip" install -q numpy==2.4.6 OpenEXR==3.5.3 pillow==13.0.0 >&2
    "$python" -c 'import numpy, OpenEXR, PIL' 2>/dev/null || {
        echo "numpy, OpenEXR and pillow are not to be had" >&2
        return 1
    }
}
