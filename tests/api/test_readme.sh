#!/bin/bash
# README.md against the programs: commands, settings with their defaults, options of the daemon,
# exit statuses, and the files that it names.
build=${1:-build}
failures=0
fail() {
    echo "README.md: $*"
    failures=$((failures + 1))
}
present() { grep -qF -- "$1" README.md || fail "there is no line with: $1"; }

while read -r name _; do
    present "| \`$name"
    for option in $("$build/unbake" "$name" --help | sed -n 's/^ *\(-., \)\?--\([a-z-]*\).*/\2/p'); do
        present "\`--$option"
    done
done < <("$build/unbake" --help | sed -n '/^commands:/,/^$/s/^  \([a-z]* .*\)/\1/p')

# A setting's row: what must be there, a tab, and the row to write where it is not.
while IFS=$'\t' read -r start row; do
    grep -qF -- "$start" README.md || fail "this row of the settings is missing or has changed: $row"
done < <("$build/unbake" settings --json -q --retry 0 --server http://127.0.0.1:1 | jq -r '.[] |
    (if .choices then .choices | join(", ") elif .minimum != null then
        ("\(.minimum) to \(.maximum) \(.unit)" | rtrimstr(" ")) elif .type == "bool" then "true, false"
     else .type end) as $values |
    "| `\(.name)` | \(.default) |\t| `\(.name)` | \(.default) | \($values) | \(.help) |"')
known=$("$build/unbake" settings -q --retry 0 --server http://127.0.0.1:1 | awk 'NR > 1 {print $1}')
for name in $(sed -n '/^## Settings/,/^## /s/^| `\([a-z_]*\)`.*/\1/p' README.md); do
    grep -qx "$name" <<<"$known" || fail "there is no setting $name"
done

while read -r name _ default; do present "| \`$name\` | $default"; done \
    < <(sed -n 's/^\([a-z_]*\) \(=\) *\(.*\)/\1 \2 \3/p' config/unbaked.conf)

while read -r status meaning; do
    present "| $status | ${meaning%%[,;]*}" || fail "exit status $status"
done < <("$build/unbake" --help | sed -n '/^exit status:/,$s/^  \([0-9][0-9]*\) *\(.*\)/\1 \2/p')

# Paths in backquotes; a bare name belongs to the folder named before it in the same cell.
while IFS= read -r row; do
    folder=.
    for path in $(grep -o '`[A-Za-z0-9_/.]*\.[a-z]*`' <<<"$row" | tr -d '\`'); do
        case $path in */*) folder=${path%/*} ;; *) path=$folder/$path ;; esac
        [ -e "$path" ] || fail "there is no file $path"
    done
done < <(sed -n '/^## Reading order/,/^## One/p' README.md | grep '^| `')
for path in $(grep -o '](\([a-z/_.]*\))' README.md | tr -d '()]'); do
    [ -e "$path" ] || fail "there is no file $path"
done
exit $((failures > 0))
