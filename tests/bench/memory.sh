#!/bin/bash
# Peak memory of a reconstruction of the room bathroom at 8192 x 8192, from reading the room to
# writing the outputs. The optimiser runs for a short while only: all that it holds is there from
# its first step on. Prints a line "name value goal better". usage: memory.sh BUILD
set -u
build=$1
. tests/bench/lib.sh
room=$data/rooms/bathroom
out=$build/bench/memory
if [ ! -d "$room" ]; then
    echo "no test data: the line on memory is left out"
    exit 77
fi
reconstruct "$room" "$out" texture_size=8192 time_limit_sec=30 report_samples=1 || exit 1
rm -rf "$out"
awk '/^peak memory/ { printf "peak memory of 8192 x 8192 (bathroom), GiB\t%.3f\t8\tlower\n", $3 / 1024 }' "$out.log"
