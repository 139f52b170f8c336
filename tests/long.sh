#!/bin/bash
# long.sh NAME BUILD [ONE]: runs the tests of tests/NAME in their long form (UNBAKE_LONG=1), or only
# those with ONE in their names. A line "figure<TAB>value<TAB>goal<TAB>lower|higher" that one
# prints becomes a row of the table and of BUILD/NAME.json; all else is shown as it comes. In their
# short form the same tests are part of `make test`.
set -u
name=$1 build=$2 one=${3:-}
rows=$build/$name.tsv
failed=0
: >"$rows"
export UNBAKE_BUILD=$build UNBAKE_LONG=1

for source in tests/"$name"/test_*.c tests/"$name"/test_*.sh; do
    [ -e "$source" ] && [[ -z $one || $source == *"$one"* ]] || continue
    case $source in
    *.c) set -- "$build/${source%.c}" ;;
    *.sh) set -- bash "$source" "$build" ;;
    esac
    start=$SECONDS
    echo "== $source"
    "$@" </dev/null 2>&1 | while IFS= read -r line; do
        case $line in
        *$'\t'*$'\t'*$'\t'*) printf '%s\n' "$line" >>"$rows" ;;
        *) printf '%s\n' "$line" ;;
        esac
    done
    code=${PIPESTATUS[0]}
    echo "   exit $code after $((SECONDS - start)) s"
    [ "$code" -eq 0 ] || [ "$code" -eq 77 ] || failed=$((failed + 1))
done

tests/table.sh "$rows" "$build/$name.json"
rm -f "$rows"
[ "$failed" -eq 0 ]
