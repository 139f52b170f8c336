#!/bin/bash
# Turns rows "name<TAB>value<TAB>goal<TAB>better" (better: higher or lower; a goal of "-": none) into a
# table on stdout and a list of {"name", "value", "goal", "better"}. usage: table.sh ROWS JSON
set -u
awk -F '\t' '
    BEGIN { print "[" }
    { printf "%s{\"name\": \"%s\", \"value\": %s, \"goal\": %s, \"better\": \"%s\"}", (NR > 1 ? ",\n" : ""),
             $1, $2, ($3 == "-" ? "null" : $3), $4 }
    END { print "\n]" }' "$1" >"$2"
printf '\n%-72s %10s %10s\n' what value goal
awk -F '\t' '{
    met = ($3 == "-") || $2 != "null" && (($4 == "higher") ? ($2 + 0 >= $3 + 0) : ($2 + 0 <= $3 + 0))
    value = ($2 == "null") ? "none" : sprintf("%.4g", $2)
    printf "%-72s %10s %7s %-2s %s\n", $1, value, $3, ($4 == "higher" ? "+" : "-"), (met ? "" : "not met")
}' "$1"
