#!/bin/bash
# Webhooks: every state of a job is told, signed; a receiver that fails is called again, also after a
# restart of the daemon; private addresses are not called unless the configuration lets them be.
set -u
. tests/api/client.sh "$@"
secret=a-secret-of-sixteen-bytes
# receive STATUS...: a receiver of messages, which go to $work/hook.
receive() {
    : >"$work/hook"
    "$build/tests/api/hook" "$secret" "$@" >"$work/hook" & background=$!
    wait_for 60 test -s "$work/hook"
    hook=http://127.0.0.1:$(head -n 1 "$work/hook")
}
told() { sed 1d "$work/hook"; }
# tells N FILTER: after a while N messages are so.
tells() { wait_for 60 sh -c "[ \$(sed 1d '$work/hook' | jq -c 'select($2)' | wc -l) -ge $1 ]" || fail "told was: $(told)"; }

make_room "$work/room"
receive 500 302 200
daemon_start --set webhook_private=yes
quick=$tiny
UNBAKE_WEBHOOK_SECRET=$secret run 0 submit "$work/room" $quick --name told --label a=b --webhook "$hook/here?x=1" --watch -q
tells 1 '.body.data.state == "succeeded"'
tells 2 '.body.data.state == "running"' # refused, and once more
equal "$(told | jq -s 'all(.good)')" true "signatures"
equal "$(told | jq -s 'all(.path == "/here?x=1" and .body.type == "job.state" and .body.data.id == 1 and .body.data.name == "told" and .body.data.labels.a == "b")')" true "$(told)"
equal "$(told | jq -s '[.[] | select(.body.data.state == "running") | .id] | unique | length')" 1 "ids of one message sent twice"
run 0 show 1 --json
equal "$(jq -r .webhook <<<"$out")" "$hook/here?x=1"
[[ $out != *"$secret"* ]] || fail "the secret is shown"

# A receiver that is away, and a daemon that ends meanwhile.
kill "$background"; wait "$background" 2>/dev/null
UNBAKE_WEBHOOK_SECRET=$secret run 0 submit "$work/room" $quick --webhook "$hook" --watch -q
wait_for 60 grep -q 'its webhook cannot be called: cannot reach' "$work/log"
daemon_end KILL
port_of_hook=${hook##*:}
"$build/tests/api/hook" "$secret" >/dev/null & # takes another port: nobody is at the old one
other=$!
daemon_start --set webhook_private=yes
kill "$other"
equal "$(echo "SELECT count(*) FROM outbox" | sqlite3 "$data/state.db" 2>/dev/null || echo locked)" locked "the database's lock"
curl -s "$url/metrics" | grep -q '^unbaked_outbox [1-9]' || fail "$(curl -s "$url/metrics" | grep outbox)"
daemon_end TERM

# Not to private addresses, by name or by number.
receive
daemon_start
for host in 127.0.0.1 localhost '[::1]' 0.0.0.0; do
    UNBAKE_WEBHOOK_SECRET=$secret run 0 submit "$work/room" $quick --webhook "http://$host:${hook##*:}/" --watch -q
done
wait_for 60 sh -c "[ \$(grep -c 'an address of a private network' '$work/log') -ge 4 ]"
# Another try would end the same: none is made, and the job says so.
grep -q 'cannot be called: .*private network' "$work/log" && fail "a private address is to be called again"
wait_for 60 sh -c "'$build/unbake' show last --json | jq -e '.webhook_delivery | .state == \"failed\" and .pending == 0 and .attempts == 1'"
run 0 show last; has "$out" "private network"
run 0 redeliver last
wait_for 60 sh -c "'$build/unbake' show last --json | jq -e '.webhook_delivery.pending == 0'"
equal "$(told | wc -l)" 0 "messages to private addresses"

# Faults of a submission.
scene=$(curl -s "$url/v1/scenes" | jq -r '.items[0].id')
for bad in '"x"' '{}' '{"url":"http://x/"}' '{"url":"http://x/","secret":"short"}' '{"url":"ftp://x/","secret":"0123456789abcdef"}' \
    '{"url":"http://x/","secret":"0123456789abcdef","more":1}' 'null' '{"url":7,"secret":"0123456789abcdef"}'; do
    call POST /v1/jobs -H 'Content-Type: application/json' -d "{\"scene\":\"$scene\",\"webhook\":$bad}"
    expect 422 "webhook $bad"
    equal "$(field '.invalid_params[0].name')" webhook
done
run 2 submit "$work/room" --webhook "http://x/"
has "$err" UNBAKE_WEBHOOK_SECRET
stop_daemon
finish
