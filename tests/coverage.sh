#!/bin/bash
# coverage.sh BUILD [NAME]: runs the tests of BUILD, which counts the lines that it runs, all of them or
# those with NAME in their names; prints what share of the lines was reached, by file and by part, and
# writes build/coverage.json. build/coverage/lines.html shows the lines themselves.
#
# A process that is killed writes no counts. Exits with 1 when a test failed.
set -u
build=$1 one=${2:-}
rows=$build/coverage.tsv

find "$build/obj" -name '*.gcda' -delete
bash tests/run.sh "$one" "$build"
failed=$?

# Branches are not told, lines are.
gcovr --root . --filter 'server/' --filter 'common/' --filter 'client/' --exclude-unreachable-branches \
    --json-summary-pretty --json-summary "$build/coverage.json" --html-details "$build/lines.html" --txt "$build/coverage.txt" \
    "$build/obj" || exit 1
cat "$build/coverage.txt"

# part NAME REGULAR-EXPRESSION GOAL: a row.
part() {
    jq -r --arg name "lines reached: $1" --arg files "$2" --arg goal "$3" '
        [.files[] | select(.filename | test($files))]
        | [$name, ((map(.line_covered) | add) / (map(.line_total) | add) * 1000 | round / 10), $goal, "higher"] | @tsv' \
        "$build/coverage.json" >>"$rows"
}
: >"$rows"
part "the daemon (server/*.c, admin, http, job, store), %" '^server/([^/]*|(admin|http|job|store)/.*)$' 90
part "the worker, %" '^server/worker/' 90
part "ingest, %" '^server/ingest/' -
part "common, %" '^common/' -
part "the client, %" '^client/' -
part "the engine and its tools, %" '^server/(demo|evaluate|export|reconstruct|render|scene)/' -
part "all, %" '' -
bash tests/table.sh "$rows" build/coverage.json
exit $failed
