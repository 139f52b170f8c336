#!/bin/bash
# coverage.sh BUILD [NAME]: runs the tests of BUILD, which counts the lines that it runs, all of them or
# those with NAME in their names; prints what share of the lines was reached, by file and by part, and
# writes build/coverage.json. build/coverage/lines.html shows the lines themselves.
#
# Of the daemon's own code it also says how many of the places where an error is dealt with were reached (which
# these are: tests/error_sites.awk), and lists the others in build/coverage/errors.txt.
#
# A process that is killed writes no counts. Exits with 1 when a test failed.
set -u
build=$1 one=${2:-}
rows=$build/coverage.tsv

find "$build/obj" -name '*.gcda' -delete
TEST_TIMEOUT=${TEST_TIMEOUT:-1800} bash tests/run.sh "$one" "$build" # counting is slow
failed=$?

# Branches are not told, lines are.
gcovr --root . --filter 'server/' --filter 'common/' --filter 'client/' --exclude-unreachable-branches \
    --json-summary-pretty --json-summary "$build/coverage.json" --html-details "$build/lines.html" --txt "$build/coverage.txt" \
    "$build/obj" || exit 1
cat "$build/coverage.txt"

daemon='^server/([^/]*|(admin|data|events|http|job|net|store|transport|uploads)/.*)$'
# part NAME REGULAR-EXPRESSION GOAL: a row.
part() {
    jq -r --arg name "lines reached: $1" --arg files "$2" --arg goal "$3" '
        [.files[] | select(.filename | test($files))]
        | [$name, ((map(.line_covered) | add) / (map(.line_total) | add) * 1000 | round / 10), $goal, "higher"] | @tsv' \
        "$build/coverage.json" >>"$rows"
}
: >"$rows"
part "the daemon (server/*.c, admin, http, job, store), %" "$daemon" 90
part "the worker, %" '^server/worker/' 90
part "ingest, %" '^server/ingest/' -
part "common, %" '^common/' -
part "the client, %" '^client/' -
part "the engine and its tools, %" '^server/(demo|evaluate|export|reconstruct|render|scene)/' -
part "all, %" '' -
find "$build/obj/server" -name '*.gcno' -exec gcov -t -b -c {} + 2>/dev/null |
    awk -v files="$daemon" -f tests/error_sites.awk >"$build/sites.tsv"
awk -F '\t' '$2 == 0 { print $1 ": " $3 }' "$build/sites.tsv" >"$build/errors.txt"
awk -F '\t' '{ reached += $2 }
    END { printf "errors dealt with: places in the daemon\t%d\t-\thigher\n", NR
          printf "errors dealt with: of them reached\t%d\t%d\thigher\n", reached, NR }' "$build/sites.tsv" >>"$rows"
bash tests/table.sh "$rows" build/coverage.json
exit $failed
