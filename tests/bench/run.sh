#!/bin/bash
# Runs the benches that were built under $1. What a bench prints as "name<TAB>value<TAB>goal<TAB>better"
# becomes a row of the table and of $1/bench.json; all else it prints is shown as it comes. With
# LONG=1 in the environment also the benches that take many minutes: memory.sh, race.sh.
#
# Mitsuba 3 is taken from PyPI into $1/mitsuba; its llvm mode needs Debian's libllvm19. Where either
# is not to be had, or the test data is not, the lines that need it are left out, and that is said.
set -u
build=$1
export UNBAKE_BUILD=$build
rows=$build/bench.tsv
. tests/bench/lib.sh
: >"$rows"

collect() {
    "$@" | while IFS= read -r line; do
        case $line in
        *$'\t'*$'\t'*$'\t'*) printf '%s\n' "$line" >>"$rows" ;;
        *) printf '%s\n' "$line" >&2 ;;
        esac
    done
}

has_mitsuba=
mitsuba_ready && has_mitsuba=1 || echo "the lines against Mitsuba 3 are left out" >&2
for bench in "$build"/tests/bench/bench_*; do
    [ -x "$bench" ] && [ -f "$bench" ] || continue
    echo "== ${bench##*/}" >&2
    case $bench in
    */bench_mitsuba) [ -n "$has_mitsuba" ] && collect "$bench" "$build/mitsuba/bin/python" ;;
    *) collect "$bench" ;;
    esac
done

echo "== a relit preview" >&2
collect tests/bench/relit_preview.sh "$build"

if [ "${LONG:-}" = 1 ]; then
    echo "== memory" >&2
    collect tests/bench/memory.sh "$build"
    echo "== time to a quality" >&2
    [ -n "$has_mitsuba" ] && collect tests/bench/race.sh "$build" "$build/mitsuba/bin/python"
else
    echo "left out: peak memory, time to a quality against Mitsuba 3 (make bench LONG=1)" >&2
fi

tests/table.sh "$rows" "$build/bench.json"
rm -f "$rows"
