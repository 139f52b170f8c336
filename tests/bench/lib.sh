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
