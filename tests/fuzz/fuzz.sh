#!/bin/bash
# fuzz.sh BUILD [ONE]: lets libFuzzer (build/fuzz/tests/fuzz) look for inputs that crash each target, or
# only those with ONE in their names, for FUZZ_SECONDS (60) or FUZZ_RUNS executions each. Writes
# BUILD/fuzz.json.
#
# A header that lies about a large picture, within what is allowed, gets memory that nothing is ever written
# to: what counts is what is used.
#
# It starts from the seeds and from what earlier runs found worth keeping (build/fuzz/corpus). An
# input that crashes, leaks, or takes more than a minute or 3 GiB is kept as
# build/fuzz/found-TARGET-HASH, and the exit status is 1. `build/tests/fuzz/test_TARGET FILE` runs it.
set -u
build=$1 one=${2:-} seconds=${FUZZ_SECONDS:-60} runs=${FUZZ_RUNS:--1}
work=build/fuzz
rows=$work/fuzz.tsv
failed=0
: >"$rows"
# Little is kept of what was freed, and of where: more executions instead.
export ASAN_OPTIONS=quarantine_size_mb=8:malloc_context_size=8${ASAN_OPTIONS:+:$ASAN_OPTIONS}

for source in tests/fuzz/test_*.c; do
    name=${source#tests/fuzz/test_}
    name=${name%.c}
    [[ -z $one || $name == *"$one"* ]] || continue
    seeds=$work/seeds/$name corpus=$work/corpus/$name log=$work/$name.log dictionary=tests/fuzz/$name.dict
    rm -rf "$seeds"
    mkdir -p "$seeds" "$corpus"
    "$build/tests/fuzz/test_$name" --seeds "$seeds" || continue
    case $name in # no longer than it takes to say all there is to say; the mutants of make test are longer
    archive) length=32768 ;;
    bundle | exr | heif | jpeg | png | progress | tiff | webp) length=4096 ;;
    *) length=1024 ;;
    esac
    options=(-max_total_time="$seconds" -runs="$runs" -max_len=$length -timeout=60 -rss_limit_mb=3072
        -malloc_limit_mb=200000 -artifact_prefix="$work/found-$name-" -print_final_stats=1)
    [ ! -e "$dictionary" ] || options+=(-dict="$dictionary")
    crashes=0
    "$work/tests/fuzz/test_$name" "${options[@]}" "$corpus" "$seeds" >"$log" 2>&1 </dev/null || crashes=1
    executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log" | tail -n 1)
    edges=$(sed -n 's/.* cov: \([0-9]*\) .*/\1/p' "$log" | tail -n 1)
    printf '%-12s %10s executions, %6s edges%s\n' "$name" "${executions:-?}" "${edges:-?}" \
        "$([ $crashes = 0 ] || echo ", crashed: $log")"
    printf '%s: inputs that crash\t%d\t0\tlower\n' "$name" "$crashes" >>"$rows"
    printf '%s: executions\t%d\t%s\thigher\n' "$name" "${executions:-0}" \
        "$([ "$seconds" -ge 900 ] && echo - || echo 10000000)" >>"$rows"
    [ $crashes = 0 ] || failed=1
done

bash tests/table.sh "$rows" "$build/fuzz.json"
exit $failed
