#!/bin/bash
# Runs the tests that were built under $1; $2, if given, is part of a test's name.
# One line a test; a failing test's output follows its line. Last: "N passed, N failed, N skipped".
set -u
build=$1
only=${2:-}
export UNBAKE_BUILD=$build
logs=$build/logs
mkdir -p "$logs"
passed=0 failed=0 skipped=0

run_one() {
    local name=$1
    shift
    local log=$logs/${name//\//_}.log start=$SECONDS code
    timeout "${TEST_TIMEOUT:-600}" "$@" >"$log" 2>&1 </dev/null
    code=$?
    local took=$((SECONDS - start))
    case $code in
    0) passed=$((passed + 1)); printf 'ok    %-40s %4d s\n' "$name" "$took" ;;
    77) skipped=$((skipped + 1)); printf 'skip  %-40s %s\n' "$name" "$(tail -n 1 "$log")" ;;
    *) failed=$((failed + 1)); printf 'FAIL  %-40s %4d s, exit %d\n' "$name" "$took" "$code"
       tail -n 40 "$log" | sed 's/^/      /' ;;
    esac
}

[ -n "$only" ] || run_one includes tests/includes.sh
for source in tests/unit/test_*.c tests/gradient/test_*.c tests/render/test_*.c \
    tests/api/test_*.c tests/api/test_*.sh tests/fuzz/test_*.c tests/fuzz/test_*.sh; do
    [ -e "$source" ] || continue
    name=${source#tests/}
    name=${name%.*}
    [[ -z $only || $name == *"$only"* ]] || continue
    case $source in
    *.c) run_one "$name" "$build/tests/$name" ;;
    *.sh) run_one "$name" bash "$source" "$build" ;;
    esac
done

if [ $((passed + failed + skipped)) -eq 0 ]; then
    echo "no test is named like '$only'" >&2
    exit 2
fi
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
