#!/bin/bash
# The daemon as a process: flags, lock, ports, stopping with open streams, what it says of itself.
set -u
. tests/api/lib.sh "$@"

# --- flags and configuration ---
"$build/unbaked" --version >"$work/out" || fail "--version fails"
grep -q '^unbaked 0' "$work/out" && grep -q '^sqlite 3' "$work/out" || fail "--version: $(cat "$work/out")"
"$build/unbaked" --help | grep -q -- '--port-file' || fail "--help says little"
"$build/unbaked" --bogus 2>"$work/err"; equal $? 2 "exit status of an unknown flag"
"$build/unbaked" --data 2>"$work/err"; equal $? 2 "exit status of a flag without its value"
printf 'max_runing = 1\nthreads = -1\n' >"$work/bad.conf"
"$build/unbaked" --check-config --config "$work/bad.conf" 2>"$work/err"; equal $? 2 "exit status of a bad file"
grep -q 'bad.conf:1: .*did you mean max_running' "$work/err" && grep -q 'bad.conf:2: threads' "$work/err" ||
    fail "not all problems at once: $(cat "$work/err")"
"$build/unbaked" --check-config --config config/unbaked.conf || fail "config/unbaked.conf is refused"
"$build/unbaked" --check-config --listen 0.0.0.0 2>"$work/err"; equal $? 2 "exit status without a port"

# --- life ---
start_daemon --set keepalive_sec=1
equal "$(cat "$work/stdout")" "$url" "what it prints"
grep -q 'unbaked .*libmicrohttpd .*sqlite .*embree .*libarchive' "$work/log" || fail "no versions in the log"
call GET /healthz; expect 200
call GET /readyz; expect 200; equal "$(field .status)" ready
call HEAD /; expect 200; equal "$(header content-type)" application/json
# The web page: for browsers only, and running nothing but its own scripts.
call GET / -H 'Accept: text/html,*/*;q=0.8'; expect 200; equal "$(header content-type)" "text/html; charset=utf-8"
for part in web/page.css web/page.js; do
    grep -qF "\"$part\"" "$work/body" || fail "the page does not name $part"
done
cmp -s "$work/body" server/web/index.html || fail "the page is not the file"
header content-security-policy | grep -q "default-src 'none'; script-src 'self'" || fail "the page may run anything"
for file in server/web/*.css server/web/*.js; do
    call GET "/web/${file##*/}"; expect 200; cmp -s "$work/body" "$file" || fail "/web/${file##*/} is not $file"
    case $file in *.js)
        grep -nE 'innerHTML|insertAdjacentHTML|document\.write|eval\(' "$file" && fail "$file takes texts for markup"
        [ -z "$(command -v node)" ] || { cp "$file" "$work/page.mjs"; node --check "$work/page.mjs" || fail "$file is no JavaScript"; }
        for module in $(sed -nE 's|.*(from\|import\() ?"\./([a-z_.]*)".*|\2|p' "$file"); do
            [ "$module" = three.module.js ] || [ -f "server/web/$module" ] || fail "$file imports $module, which is not there"
        done
    esac
done
call GET /web/three.module.js; expect 200; cmp -s "$work/body" /usr/share/javascript/three/three.module.js || fail "three.js is another"
call GET /web/none.js; expect 404
# Links get parameters on their way, for a cache or a count of visitors; requests of the API are refused with unknown ones.
for path in '/?utm_source=mail' '/?x' '/web/page.js?v=2' '/healthz?1' '/readyz?1' '/metrics?1' '/openapi.json?1'; do
    call GET "$path" -H 'Accept: text/html,*/*;q=0.8'; expect 200 "$path"
done
call GET '/v1/jobs?lmit=2'; expect 400 "an unknown parameter"
for id in $(cat server/web/*.js | grep -o '\$("[a-z-]*")' | tr -d '$()"' | sort -u); do
    grep -q "id=\"$id\"" server/web/index.html || fail "the page has no $id"
done
call GET /v1/version; equal "$(field .libraries.sqlite)" "$(sed -n 's/^sqlite //p' "$work/out")"
call GET /metrics; grep -q '^unbaked_jobs{state="queued"} 0$' "$work/body" || fail "no figures"
"$build/unbaked" --data "$data" --listen 127.0.0.1:0 2>"$work/err"; equal $? 1 "a second daemon's exit status"
grep -q "already has a daemon (process $daemon_pid)" "$work/err" || fail "second daemon: $(cat "$work/err")"
call GET /healthz; expect 200 "health after the second daemon"
kill -HUP "$daemon_pid"; call GET /healthz; expect 200 "health after SIGHUP"

# --- the interface against its description: each path and method is answered, nothing else is ---
call GET /openapi.json; expect 200; cp "$work/body" "$work/openapi"
cmp -s "$work/openapi" server/http/openapi.json || fail "/openapi.json is not the file"
jq -r '.paths | to_entries[] | .key as $p | .value | keys[] | select(. != "parameters") | "\(ascii_upcase) \($p)"' \
    "$work/openapi" | sort >"$work/described"
sed -n 's/^ *{METHOD_\([A-Z]*\), "\([^"]*\)".*/\1 \2/p' server/http/routes.c | sed 's/\.\.\.}/}/' | sort >"$work/table"
diff "$work/described" "$work/table" || fail "openapi.json and the route table differ"
# Who may use it without a token is said, and what any request may get.
sed -n 's/^ *{METHOD_\([A-Z]*\), "\([^"]*\)", ROUTE_PUBLIC,.*/\1 \2/p' server/http/routes.c | sort >"$work/public"
jq -r '.paths | to_entries[] | .key as $p | .value | to_entries[] | select(.value.security? == []) | "\(.key | ascii_upcase) \($p)"' \
    "$work/openapi" | sort | diff - "$work/public" || fail "openapi.json and the route table differ in what is public"
for code in 400 403 415 417 500; do
    equal "$(jq -r --arg c $code '[.paths[] | to_entries[] | select(.key != "parameters") | .value
        | select(.responses[$c] == null) | .operationId] | join(" ")' "$work/openapi")" "" "operations without $code"
done
while read -r method path; do
    concrete=$(sed 's/{scene}/0123456789abcdef/; s/{job}/4242/; s/{upload}/0123456789abcdef/; s/{name}/none.exr/; s|^/v1/events|&?wait=1|' <<<"$path")
    case $method in POST | PATCH) extra=(-H 'Content-Type: application/json' -H 'If-Match: *' --data-binary '{}') ;; *) extra=() ;; esac
    call "$method" "$concrete" ${extra[@]+"${extra[@]}"}
    answers=$(jq -r --arg p "$path" --arg m "${method,,}" '.paths[$p][$m].responses | keys | join(" ")' "$work/openapi")
    [[ " $answers " == *" $status "* ]] || fail "$method $concrete gives $status; described are $answers"
    [ "$status" -lt 400 ] || equal "$(field .status)" "$status" "status in the problem of $method $concrete"
    grep -qi '^x-request-id: ' "$work/head" || fail "$method $concrete: no X-Request-Id"
    [ "$method" = GET ] || continue
    call HEAD "$concrete"
    [[ " $answers " == *" $status "* ]] || fail "HEAD $concrete gives $status"
done <"$work/described"
call PUT /v1/jobs; expect 405; equal "$(header allow)" "GET, HEAD, POST" Allow
# Every query parameter of the table is described.
for name in $(sed -n 's/^ *{METHOD.*, "\([a-z_ ]*\)"},$/\1/p' server/http/routes.c | tr ' ' '\n' | sort -u); do
    jq -e --arg n "$name" '[.. | objects | select(.in? == "query") | .name] | index($n)' "$work/openapi" >/dev/null ||
        fail "the query parameter $name is not described"
done

# --- stopping with streams open, and with an upload under way ---
head -c 100000 /dev/urandom >"$work/junk"
call POST /v1/scenes -T "$work/junk"; scene=$(field .id)
background=
for i in $(seq 20); do
    curl -sN -m 60 "$url/v1/events" >"$work/stream$i" 2>/dev/null & background="$background $!"
done
head -c 100000 /dev/urandom >"$work/more"
curl -s -m 60 --limit-rate 2k -T "$work/more" -X POST "$url/v1/scenes" >/dev/null 2>&1 & upload=$!
streams_are_open() { curl -s "$url/metrics" | grep -qx 'unbaked_event_streams 20'; }
wait_for 60 streams_are_open
has_upload() { [ -n "$(ls -A "$data/uploads")" ]; }
wait_for 60 has_upload
stop_daemon
kill "$upload" # it would go on waiting for its rate
equal "$daemon_status" 0 "exit status after SIGTERM"
tail -n 1 "$work/log" | grep -q 'stopped$' || fail "the log does not end with 'stopped'"
for pid in $background; do wait "$pid"; done
background=
equal "$(ls -A "$data/uploads")" "" "left in uploads/"

# --- SIGKILL, and up again ---
start_daemon
kill -KILL "$daemon_pid"; wait "$daemon_pid" 2>/dev/null
mkdir -p "$data/uploads" "$data/scenes/0000"; echo left >"$data/uploads/abc"
start_daemon
call GET /readyz; expect 200 "ready after SIGKILL"
equal "$(ls -A "$data/uploads")" "" "left in uploads/ after SIGKILL"
[ ! -e "$data/scenes/0000" ] || fail "a scene's folder without a row is kept"
[ -e "$data/scenes/$scene/archive" ] || fail "the scene's archive is gone"
kill -INT "$daemon_pid"; wait "$daemon_pid"; equal $? 0 "exit status after SIGINT"; daemon_pid=

# --- for its user alone: what is made, and what an earlier version has left open ---
equal "$(find "$data" ! -type l -perm /077)" "" "open to others"
chmod 755 "$data" "$data/jobs"; chmod 644 "$data/state.db" "$data/lock"
echo public >"$work/public"; chmod 644 "$work/public"; ln -s "$work/public" "$data/link"
start_daemon
equal "$(find "$data" ! -type l -perm /077)" "" "open to others after an upgrade"
equal "$(stat -c %a "$work/public")" 644 "what a link names"
grep -q "data folder $data: 4 of its files and folders were open to other users and are closed now" "$work/log" || fail "$(tail "$work/log")"
stop_daemon
finish
