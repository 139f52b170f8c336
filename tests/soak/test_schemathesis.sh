#!/bin/bash
# The daemon against its description, by schemathesis (https://schemathesis.io): requests made from openapi.json, good
# and bad ones, and whether the replies are as it says. It is installed into BUILD/schemathesis from PyPI, by
# the long form only (`make soak`); the short form runs fewer examples where it is there. Event streams, which
# do not end, are apart: tests/api/test_http_events.c and test_http_global.c have them.
. tests/api/client.sh "$@"

version=4.32.5
tool=$build/schemathesis/bin/schemathesis # $build is absolute
if [ ! -x "$tool" ]; then
    [ -n "${UNBAKE_LONG:-}" ] || { echo "there is no schemathesis (make soak installs it)"; exit 77; }
    python3 -m venv "$build/schemathesis" && "$build/schemathesis/bin/pip" install -q "schemathesis==$version" ||
        { rm -rf "$build/schemathesis"; echo "schemathesis cannot be installed"; exit 77; }
fi

mkdir -m 750 "$data"
token=$("$build/unbaked" token add ada --role admin --data "$data" 2>/dev/null)
export UNBAKE_TOKEN=$token SCHEMATHESIS_HOOKS=schemathesis_hooks PYTHONPATH=$PWD/tests/soak PYTHONDONTWRITEBYTECODE=1
daemon_start --set max_upload_mib=1 --set trusted_proxies=127.0.0.1 --set queue_limit=1000000
make_room "$work/room"
for n in 1 2 3; do
    run 0 submit "$work/room" --set texture_size=64 --set iterations=1 --set texels_per_iteration=64 --set report_samples=1 --watch
done

# What depends on the state of things is no fault of a request that is well formed (412, 413, 422, and 400 for a cursor
# that no page gave), and a fault may be told by the protocol's own status: 412 and 460 by tus, 417, 416.
cat >"$work/config.toml" <<'TOML'
[generation]
allow-extra-parameters = false
[checks.positive_data_acceptance]
expected-statuses = ["2xx", "3xx", "400", "401", "403", "404", "409", "412", "413", "415", "416", "422", "428", "429", "460", "503", "507"]
[checks.negative_data_rejection]
expected-statuses = ["400", "401", "403", "404", "405", "406", "409", "412", "413", "415", "416", "417", "422", "428", "429", "460"]
[checks.missing_required_header]
expected-statuses = ["400", "401", "403", "412", "415", "422", "428"]
[[operations]]
include-method = "OPTIONS"
[operations.checks.use_after_free]
enabled = false # what an OPTIONS tells is of the protocol, not of an upload
TOML
long=${UNBAKE_LONG:-}
cd "$work" || exit 1 # where it leaves what it has learnt
"$tool" --config-file "$work/config.toml" run "$UNBAKE_SERVER/openapi.json" -H "Authorization: Bearer $token" \
    --exclude-path-regex '/events$' --max-examples "$([ -n "$long" ] && echo 60 || echo 5)" --seed 1 --continue-on-failure \
    --suppress-health-check all --request-timeout 30 --no-color --warnings off >"$work/out" 2>&1
code=$?
cd - >/dev/null || exit 1
[ $code -eq 0 ] || { fail "schemathesis ends with $code"; sed -n '/= FAILURES =/,$p;/= ERRORS =/,$p' "$work/out"; tail -n 30 "$work/out"; }
cases=$(sed -n 's/^ *\([0-9]*\) generated.*/\1/p' "$work/out" | head -n 1)
printf 'cases against openapi.json, with 0 findings\t%s\t1000\thigher\n' "${cases:-0}"
call GET /readyz; expect 200 "ready after all of them"
daemon_end TERM; equal $? 0 "the daemon's exit status"
finish
