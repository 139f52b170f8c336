#!/bin/bash
# Jobs over HTTP: submission and its faults, idempotency, pages, ETags, PATCH, actions in every
# state. No job runs: tests/api/idle.c moves them.
set -u
. tests/api/lib.sh "$@"
post() { local path=$1 body=$2; shift 2; call POST "$path" -H 'Content-Type: application/json' --data-binary "$body" "$@"; }
patch() { local path=$1 body=$2; shift 2; call PATCH "$path" -H 'Content-Type: application/merge-patch+json' --data-binary "$body" "$@"; }
# move COMMAND...: has the store do what a scheduler would.
move() { echo "$*" >&"${idle[1]}"; read -r answer <&"${idle[0]}"; equal "$answer" ok "$*"; }
state() { call GET "/v1/jobs/$1"; equal "$(field .state)" "$2" "state of job $1"; }

coproc idle { exec "$build/tests/api/idle"; }
read -r url scene idle_dir <&"${idle[0]}"

# --- faults, all at once ---
post /v1/jobs '{"settings":{"textur_size":1,"seed":"x"},"priority":101,"labels":{"a":1},"nme":"x"}'; expect 422
for name in settings.textur_size settings.seed priority labels nme scene; do
    jq -e --arg n "$name" '.invalid_params | map(.name) | index($n)' "$work/body" >/dev/null || fail "$name is not named: $(cat "$work/body")"
done
field '.invalid_params[] | select(.name == "settings.textur_size") | .hint' | grep -q texture_size || fail "no hint for textur_size"
post /v1/jobs '{"scene":"nothex"}'; expect 422
post /v1/jobs '{"scene":"00000000000000000000"}'; expect 422 "an unknown scene"
post /v1/jobs "{\"scene\":\"$scene\",\"settings\":[]}"; expect 422
post /v1/jobs "{\"scene\":\"$scene\",\"settings\":{\"emitters\":\"any\"}}"; expect 422 "a setting of the other method"
equal "$(field '.invalid_params[0] | .name, .reason' | tr '\n' ' ')" \
    "settings.emitters only method=listing1 uses it, and the method is solve "
post /v1/jobs "{\"scene\":\"$scene\",\"name\":\"\"}"; expect 422
post /v1/jobs "{\"scene\":\"$scene\",\"name\":7}"; expect 422
# What a name would do to a terminal, or to the text beside it, it must not hold; marks that scripts need it may.
for bad in '"name":"a\u001b[2Jb"' '"name":"a\u202eb"' '"name":"a\u2066b"' '"name":"a\u2028b"' '"name":"a\u009bb"' \
    '"labels":{"a\u202eb":"c"}' '"labels":{"a":"b\nc"}'; do
    post /v1/jobs "{\"scene\":\"$scene\",$bad}"; expect 422 "$bad"
done
post '/v1/jobs?dry_run=1' "{\"scene\":\"$scene\",\"name\":\"a\\u0000b\"}"; expect 400 "a NUL in a name"
field .detail | grep -q NUL || fail "the NUL is not named: $(cat "$work/body")"
post '/v1/jobs?dry_run=1' "{\"scene\":\"$scene\",\"settings\":{\"method\":\"listing1\\u0000x\"}}"; expect 400 "a NUL in a setting"
post '/v1/jobs?dry_run=1' "{\"scene\":\"$scene\",\"name\":\"\u0645\u06cc\u200c\u062e\u0648\u0627\u0647\u0645 \ud83d\udc69\u200d\ud83d\udd2c\"}"
expect 200 "a name with joiners"
post /v1/jobs "{\"scene\":\"$scene\",\"priority\":1.5}"; expect 422
post /v1/jobs '{"scene":'; expect 400 "half a body"
post /v1/jobs '[]'; expect 400 "an array"
post /v1/jobs '{"scene":"a","scene":"b"}'; expect 400 "a key twice"
post /v1/jobs '{} x'; expect 400 "trailing text"
post /v1/jobs ''; expect 400 "no body"
call POST /v1/jobs -H 'Content-Type: text/plain' -d '{}'; expect 415
equal "$(header accept)" application/json Accept
head -c 2000000 /dev/zero | tr '\0' ' ' >"$work/large"
post /v1/jobs "@$work/large"; expect 413
post /v1/jobs "@$work/large" -H 'Transfer-Encoding: chunked'; expect 413 "too large, chunked"
post '/v1/jobs?dry_run=2' "{\"scene\":\"$scene\"}"; expect 400
post /v1/jobs "{\"scene\":\"$scene\"}" -H 'Idempotency-Key: a b'; expect 400
call GET /v1/jobs; equal "$(field '.items | length')" 0 "jobs after refusals"

# --- submission ---
post '/v1/jobs?dry_run=1' "{\"scene\":\"${scene:0:8}\",\"settings\":{\"texture_size\":512}}"; expect 200
equal "$(field .dry_run,.scene,.settings.texture_size | tr '\n' ' ')" "true $scene 512 "
post /v1/jobs "{\"scene\":\"$scene\",\"name\":\"first\",\"priority\":-3,\"labels\":{\"who\":\"me\"},\"settings\":{\"texture_size\":512}}"; expect 201
job=$(field .id)
equal "$(header location)" "/v1/jobs/$job" Location
equal "$(header etag)" "\"rev-$(field .revision)\"" ETag
equal "$(field '[.name,.state,.wanted,.priority,.labels.who,.settings.texture_size,.attempt,.stage,.reason] | map(tostring) | join(" ")')" \
    "first queued run -3 me 512 0 null null"
field .created_at | grep -qE '^20[0-9-]{8}T[0-9:]{8}\.[0-9]{3}Z$' || fail "created_at is $(field .created_at)"
post /v1/jobs "{\"scene\":\"$scene\"}"; expect 201; equal "$(field .name)" room "name taken from the scene"
post '/v1/jobs?dry_run=1' "{\"scene\":\"$scene\",\"settings\":{\"seed\":9007199254740991}}"; expect 200
grep -q '"seed":9007199254740991[,}]' "$work/body" || fail "the largest seed came back as $(field .settings.seed)"

# --- idempotency ---
body="{\"scene\":\"$scene\",\"name\":\"once\"}"
post /v1/jobs "$body" -H 'Idempotency-Key: key-1'; expect 201; once=$(field .id)
post /v1/jobs "$body" -H 'Idempotency-Key: key-1'; expect 200 "the same key"
equal "$(field .id)" "$once" "job of the same key"; equal "$(header idempotency-replayed)" true; equal "$(header location)" "/v1/jobs/$once"
post /v1/jobs "{\"scene\":\"$scene\"}" -H 'Idempotency-Key: key-1'; expect 422 "the same key, another body"
background=
for i in $(seq 30); do
    curl -s -m 60 -o "$work/parallel$i" -H 'Content-Type: application/json' -H 'Idempotency-Key: key-2' -d "$body" "$url/v1/jobs" & background="$background $!"
done
for pid in $background; do wait "$pid"; done
background=
equal "$(cat "$work"/parallel* | jq -s 'map(.id) | unique | length')" 1 "jobs made by 30 parallel posts of one key"

# --- pages ---
for i in $(seq 7); do post /v1/jobs "{\"scene\":\"$scene\",\"name\":\"n$i\"}"; expect 201; done
seen= path='/v1/jobs?state=queued&limit=3' pages=0
while [ -n "$path" ] && [ "$pages" -lt 20 ]; do
    call GET "$path"; expect 200
    seen="$seen $(field '.items[].id' | tr '\n' ' ')"
    path=$(header link | sed -n 's/^<\(.*\)>; rel="next"$/\1/p')
    pages=$((pages + 1))
done
equal "$(tr ' ' '\n' <<<"$seen" | grep . | tr '\n' ' ')" "$(seq 11 -1 1 | tr '\n' ' ')" "ids on $pages pages"
call GET '/v1/jobs?state=running'; equal "$(field '.items | length')" 0
call GET '/v1/jobs?state=asleep'; expect 400
call GET '/v1/jobs?cursor=x'; expect 400
equal "$(field .detail)" '"x" is no cursor of a list of jobs: a cursor is `next` of the page before'

# --- ETag and PATCH ---
call GET "/v1/jobs/$job"; etag=$(header etag)
call GET "/v1/jobs/$job" -H "If-None-Match: $etag"; expect 304; equal "$(wc -c <"$work/body")" 0 "bytes of a 304"
patch "/v1/jobs/$job" '{"priority":5}'; expect 428 "PATCH without If-Match"
patch "/v1/jobs/$job" '{"priority":5}' -H 'If-Match: "rev-999"'; expect 412
patch "/v1/jobs/$job" '{"priority":5}' -H 'If-Match: "x"'; expect 412
patch "/v1/jobs/$job" '{"priority":5}' -H "If-Match: W/$etag"; expect 412 "a weak ETag"
patch "/v1/jobs/$job" '{"priority":"high","state":"running"}' -H "If-Match: $etag"; expect 422
equal "$(field '.invalid_params | length')" 2 "faults of the PATCH"
patch "/v1/jobs/$job" '{"priority":5,"name":"renamed","labels":{}}' -H "If-Match: $etag"; expect 200
equal "$(field '[.priority,.name,.labels] | tojson')" '[5,"renamed",{}]'
[ "$(header etag)" != "$etag" ] || fail "the ETag did not change"
patch "/v1/jobs/$job" '{"priority":6}' -H "If-Match: $etag"; expect 412 "a stale ETag"
patch "/v1/jobs/$job" '{"priority":6}' -H 'If-Match: *'; expect 200
call GET "/v1/jobs/$job" -H "If-None-Match: $etag"; expect 200
patch /v1/jobs/4242 '{}' -H 'If-Match: *'; expect 404
patch "/v1/jobs/$job" '{"order":"middle"}' -H 'If-Match: *'; expect 422; equal "$(field '.invalid_params[0].name')" order
patch "/v1/jobs/$job" '{"order":4242}' -H 'If-Match: *'; expect 422 "before a job that is not there"
turn=$(curl -s "$url/v1/jobs/$job" | jq .turn)
patch "/v1/jobs/$job" '{"order":"last"}' -H 'If-Match: *'; expect 200
[ "$(field .turn)" -gt "$turn" ] || fail "turn $(field .turn) after $turn"
patch "/v1/jobs/$job" "{\"order\":$once}" -H 'If-Match: *'; expect 200; equal "$(field .priority)" 0 "priority of its new place"

# --- actions: act ACTION STATUS, on $job ---
act() { call POST "/v1/jobs/$job/$1"; expect "$2" "$1 of a job that is $(curl -s "$url/v1/jobs/$job" | jq -r '.state + "/" + .wanted')"; }
act resume 202; act retry 409
act pause 202; state "$job" paused; act pause 202; act retry 409
act resume 202; state "$job" queued
move start "$job"; state "$job" running; act retry 409
call DELETE "/v1/jobs/$job"; expect 409 "delete while running"
act pause 202; equal "$(field .wanted)" pause wanted; equal "$(field .state)" running
act resume 202; equal "$(field .wanted)" run "wanted, taken back"
act pause 202; move stop "$job" 1; state "$job" paused
act resume 202; move start "$job"; move fail "$job" 2; state "$job" failed
equal "$(field .reason)/$(field .hint)" "it broke/mend it"
act cancel 409; act pause 409; act resume 409; act retry 202; state "$job" queued
move start "$job"; act cancel 202; equal "$(field .wanted)" cancel wanted
move stop "$job" 3; state "$job" cancelled; act cancel 202; act retry 202
move start "$job"; move succeed "$job" 4; state "$job" succeeded; act retry 409; act cancel 409
for action in cancel pause resume retry; do call POST "/v1/jobs/4242/$action"; expect 404; done
call POST "/v1/jobs/$job/explode"; expect 404
call GET "/v1/jobs/$job/cancel"; expect 405; equal "$(header allow)" POST
call DELETE "/v1/scenes/$scene"; expect 409 "a scene with queued jobs"

# --- done again, and for longer ---
call POST "/v1/jobs/$job/retry?from=lunch"; expect 400; field .hint | grep -q refine || fail "no stages in the hint"
call POST "/v1/jobs/$job/retry?from=report"; expect 202; state "$job" queued
move start "$job"; move succeed "$job" 5
post "/v1/jobs/$job/extend" '{"looks":60}'; expect 409 "extend without a checkpoint"
mkdir -p "$idle_dir/jobs/$job/attempt-1/checkpoint"; head -c 20000 /dev/zero >"$idle_dir/jobs/$job/attempt-1/checkpoint/checkpoint.db"
for bad in '{}' '[]' '{"time_limit_sec":1,"iterations":1}'; do post "/v1/jobs/$job/extend" "$bad"; expect 400 "extend by $bad"; done
for bad in '{"looks":0}' '{"looks":"x"}' '{"looks":1e10}' '{"looks":1e-300}' '{"looks":1.5}' '{"iterations":5}' '{"time_limit_sec":60}'; do
    post "/v1/jobs/$job/extend" "$bad"; expect 422 "extend by $bad"
done
post "/v1/jobs/$job/extend" '{"looks":60}'; expect 202; equal "$(field .settings.refine_looks)" 1060
post "/v1/jobs/$job/extend" '{"looks":60}'; expect 409 "extend of a queued job"
move start "$job"; move succeed "$job" 6
call DELETE "/v1/jobs/$job?dry_run=1"; expect 200; equal "$(field .files)" 1 files; [ "$(field .bytes)" -ge 20000 ] || fail "$(field .bytes) bytes"
call DELETE "/v1/jobs/$job?dry_run=x"; expect 400
state "$job" succeeded

# --- removal ---
call DELETE "/v1/jobs/$job"; expect 204; call GET "/v1/jobs/$job"; expect 404; call DELETE "/v1/jobs/$job"; expect 404
call GET /v1/jobs/0; expect 404; call GET /v1/jobs/1x; expect 404; call GET /v1/jobs/99999999999999999999; expect 404
call GET "/v1/jobs/$(printf '%0.s%%C3%%A4' $(seq 50))x"; expect 404 "a name cut in the middle of a letter"; field .detail | iconv -f utf-8 -t utf-8 >"$work/out" || fail "the reply is no UTF-8"
call GET '/v1/jobs?name=%ff'; expect 400

# --- a full queue ---
for i in $(seq 60); do post /v1/jobs "{\"scene\":\"$scene\"}"; [ "$status" = 201 ] || break; done
expect 429 "the queue's end"
[ -n "$(header retry-after)" ] || fail "no Retry-After"
exec {idle[1]}>&-
wait "$idle_PID"; equal $? 0 "exit status of idle"
finish
