#!/bin/bash
# Peak memory of a reconstruction of the room bathroom at 8192 x 8192, from reading the room to
# writing the outputs. The optimiser runs for a short while only: all that it holds is there from
# its first step on. Prints a line "name value goal better". usage: memory.sh BUILD
set -u
build=$1
room=${UNBAKE_TEST_DATA:-../shared/data}/rooms/bathroom
if [ ! -d "$room" ]; then
    echo "no test data: the line on memory is left out"
    exit 77
fi
out=$build/bench/memory
log=$build/bench/memory.log
mkdir -p "$build/bench"
if ! "$build/tests/bench/reconstruct_room" "$room" "$out" texture_size=8192 time_limit_sec=30 \
    report_samples=2 >"$log" 2>&1; then
    tail -n 3 "$log"
    exit 1
fi
rm -rf "$out"
awk -F '[ ,]' '/^peak memory/ {
    printf "peak memory of 8192 x 8192 (bathroom), GiB\t%.3f\t8\tlower\n", $3 / 1024 }' "$log"
