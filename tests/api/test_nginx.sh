#!/bin/bash
# deploy/nginx.conf in a real nginx before a real daemon: events and uploads pass at once, tokens,
# ranges and refusals pass at all.
set -u
nginx=$(command -v nginx || ls /usr/sbin/nginx 2>/dev/null) || { echo "there is no nginx"; exit 77; }
command -v openssl >/dev/null || { echo "there is no openssl"; exit 77; }
. tests/api/client.sh "$@"

openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN=lab \
    -addext 'subjectAltName=IP:127.0.0.1' -keyout "$work/key.pem" -out "$work/cert.pem" 2>/dev/null
mkdir -m 750 "$data"
token=$("$build/unbaked" token add alice --data "$data" 2>/dev/null)
printf 'Authorization: Bearer %s\n' "$token" >"$work/token"
start_daemon --set access=tokens --set server_names=lab.example.org --set keepalive_sec=1
backend=${url#http://}
mkdir -p "$work/nginx/logs"

start_nginx() {
    front=127.0.0.1:$((20000 + RANDOM % 20000))
    {
        [ "$(id -u)" -ne 0 ] || echo 'user root;'
        echo "pid $work/nginx/pid; error_log stderr; daemon off; worker_processes 1; events {} http { access_log off;"
        for kind in client_body proxy fastcgi uwsgi scgi; do echo "${kind}_temp_path $work/nginx/$kind;"; done
        sed "s|127.0.0.1:7117|$backend|; s|listen 443 ssl|listen $front ssl|; /listen \[::\]/d
             s|/etc/ssl/certs/.*pem|$work/cert.pem|; s|/etc/ssl/private/.*key|$work/key.pem|" deploy/nginx.conf
        echo '}'
    } >"$work/nginx/conf"
    "$nginx" -p "$work/nginx" -c "$work/nginx/conf" 2>"$work/nginx/errors" &
    nginx_pid=$!
    background=$nginx_pid
    for _ in $(seq 1200); do
        kill -0 "$nginx_pid" 2>/dev/null || return 1
        curl -s --cacert "$work/cert.pem" "https://$front/healthz" >/dev/null && return 0
        sleep 0.05
    done
    return 1
}
for _ in 1 2 3 4 5; do start_nginx && break; done # another port where one is taken
url=https://$front
over() { call "$@" --cacert "$work/cert.pem" -H "@$work/token"; }

call GET /v1/jobs --cacert "$work/cert.pem"; expect 401 "without a token"
call GET /healthz --cacert "$work/cert.pem" -H 'Host: lab.example.org'; expect 200 "by its public name"
over GET /v1/session; expect 200; equal "$(field .user)" alice "who asks"
grep -qi '^x-request-id: [0-9a-f]\{32\}' "$work/head" || fail "the request id is not nginx's"

call POST /v1/session --cacert "$work/cert.pem" -H 'Content-Type: application/json' -d "{\"token\":\"$token\"}"; expect 200
grep -qi '^set-cookie: .*; Secure' "$work/head" || fail "the cookie is not kept to TLS"

# --- an upload: the daemon has the first bytes while the last are not sent yet ---
head -c 3000000 /dev/urandom >"$work/junk"
(head -c 1500000 "$work/junk"; while [ ! -e "$work/go" ]; do sleep 0.05; done; tail -c 1500000 "$work/junk") |
    curl -s -m 60 --cacert "$work/cert.pem" -H "@$work/token" -X POST -T - -o "$work/reply" "$url/v1/scenes" & sender=$!
has_bytes() { [ "$(find "$data/uploads" -type f -size +1000k | wc -l)" -gt 0 ]; }
wait_for 60 has_bytes || fail "the upload is held back"
equal "$(find "$work/nginx" -type f -size +100k)" "" "kept by nginx"
touch "$work/go"
wait "$sender"
scene=$(jq -r .id "$work/reply")
equal "$scene" "$(sha256sum "$work/junk" | cut -c 1-64)" "the scene"

# --- an upload in parts ---
head -c 2000000 "$work/junk" >"$work/part"
over POST /v1/uploads -H 'Tus-Resumable: 1.0.0' -H 'Upload-Length: 2000000'; expect 201
part=$(header location)
over PATCH "/v1/uploads/${part##*/}" -H 'Tus-Resumable: 1.0.0' -H 'Upload-Offset: 0' \
    -H 'Content-Type: application/offset+octet-stream' --data-binary "@$work/part"; expect 204

# --- events: each comes when it happens; the client ---
make_room "$work/room"
export UNBAKE_SERVER=$url UNBAKE_CA=$work/cert.pem UNBAKE_TOKEN=$token
run 0 submit "$work/room" --set texture_size=64 --set iterations=1000000000 --set texels_per_iteration=64
run 0 list -q --json
job=$(jq -r '.[0].id' <<<"$out")
curl -sN -m 600 --cacert "$work/cert.pem" -H "@$work/token" "$url/v1/jobs/$job/events" >"$work/stream" & stream=$!
wait_for 60 grep -q '^event: preview' "$work/stream"
kill -0 "$stream" 2>/dev/null || fail "the events came when the stream had ended"
run 0 get "$job" 'preview/*' -o "$work/textures" -q
run 0 cancel "$job"
wait "$stream"; equal $? 0 "the end of the stream"
grep -q '"cancelled"' "$work/stream" || fail "the last event is missing"

kill "$nginx_pid"; wait "$nginx_pid" 2>/dev/null
background=
equal "$(grep -c 'emerg\|alert' "$work/nginx/errors")" 0 "alarms in nginx's log: $(cat "$work/nginx/errors")"
stop_daemon
finish
