#!/bin/bash
# What whoever runs a daemon does: tokens with and without a running daemon, addresses that need
# them, TLS, backups, check-config, doctor, the log's formats, manual pages and completions.
set -u
. tests/api/lib.sh "$@"

unbaked() { "$build/unbaked" "$@" 2>"$work/err"; }
refused() { # WANTED-STATUS PART-OF-THE-MESSAGE COMMAND...
    local wanted=$1 part=$2
    shift 2
    "$@" >"$work/out" 2>"$work/err"
    equal $? "$wanted" "exit status of $*"
    grep -qF -- "$part" "$work/err" || fail "$*: $(cat "$work/err")"
}

# --- tokens without a daemon ---
refused 1 "make the folder for its user" unbaked token add alice --data "$data"
mkdir -m 750 "$data"
# Nothing is made of a folder that is not a daemon's.
for command in "token list" "token revoke alice" usage "backup $work/none.db"; do
    # shellcheck disable=SC2086
    refused 1 "$data is not a data folder: it has no state.db" unbaked $command --data "$data"
done
equal "$(ls -A "$data")" "" "what refused commands leave"
alice=$(unbaked token add alice --role user --data "$data") || fail "token add: $(cat "$work/err")"
grep -qF "user alice, role user, of the data folder $data, on which no daemon runs now:" "$work/err" || fail "token add says: $(cat "$work/err")"
grep -qF 'no token is an admin'"'"'s' "$work/err" || fail "no word of a daemon that nobody administers: $(cat "$work/err")"
[[ $alice =~ ^unbake_1_[0-9a-f]{48}$ ]] || fail "the token is '$alice'"
equal "$(unbaked token list --data "$data" | awk 'NR > 1 {print $1, $2, $3}')" "1 alice user" "token list"
refused 2 'there is no role "king"' unbaked token add bob --role king --data "$data"
refused 2 'is no name for a user' unbaked token add 7up --data "$data"
refused 2 'add, list, revoke' unbaked token remove alice --data "$data"
refused 2 "takes the user's NAME" unbaked token add --data "$data"
refused 2 'did you mean --role' unbaked token add bob --rolle admin --data "$data"
refused 1 'bob has no token' unbaked token revoke bob --data "$data"
grep -rqF "${alice#unbake_1_}" "$data" && fail "the token's secret is in the data folder"
refused 2 "--expires takes" unbaked token add bob --expires soon --data "$data"
refused 2 "--expires takes" unbaked token add bob --expires 0d --data "$data"
refused 2 "is past" unbaked token add bob --expires 2020-01-31 --data "$data"
refused 2 "belongs to token add" unbaked token list --expires 3d --data "$data"
# Without a role the first token is an admin's, the next a user's.
mkdir -m 750 "$work/first"
unbaked token add ada --data "$work/first" >/dev/null; grep -qF "role admin" "$work/err" || fail "the first token: $(cat "$work/err")"
unbaked token add ben --data "$work/first" >/dev/null; grep -q "role user" "$work/err" || fail "the second token: $(cat "$work/err")"
grep -qF 'no token is' "$work/err" && fail "an admin is there: $(cat "$work/err")"
equal "$(unbaked token list --data "$work/first" | awk 'NR > 1 {print $2, $3}' | xargs)" "ada admin ben user" "roles without --role"

# --- with one ---
start_daemon --set keepalive_sec=1 --set log_format=json --set trusted_proxies=127.0.0.1
equal "$(stat -c %a "$data/admin.sock")" 600 "mode of the admin socket"
admin=$(unbaked token add ada --role admin --data "$data")
viewer=$(unbaked token add wall --role=viewer --data "$data")
equal "$(unbaked token list --json --data "$data" | jq -r '[.items[].user] | join(" ")')" "alice ada wall" tokens
call GET /v1/jobs; expect 401; equal "$(header www-authenticate)" 'Bearer realm="unbaked"' WWW-Authenticate
call GET /healthz; expect 200
as() { local token=$1; shift; call "$@" -H "Authorization: Bearer $token"; }
as "$alice" GET /v1/session; equal "$(field '"\(.user) \(.role) \(.open)"')" "alice user false" session
as "$viewer" GET /v1/jobs; expect 200
as "$viewer" POST /v1/jobs -H 'Content-Type: application/json' -d '{}'; expect 403
as "${alice%?}0" GET /v1/jobs; as "${alice%?}1" GET /v1/jobs; as unbake_1_ GET /v1/jobs; expect 401
as "$alice" GET /v1/jobs -H 'Host: any.example'; expect 200 "any Host, with a token"

head -c 3000 /dev/urandom >"$work/junk"
as "$alice" POST /v1/scenes -T "$work/junk"; expect 201; scene=$(field .id); equal "$(field .owner)" alice owner
as "$admin" GET "/v1/scenes/$scene"; expect 200
as "$viewer" GET "/v1/scenes/$scene"; expect 404

# --- revoking ---
unbaked token revoke alice --data "$data" >/dev/null || fail "token revoke: $(cat "$work/err")"
as "$alice" GET /v1/jobs; expect 401 "after its revocation"
unbaked token revoke 2 --data "$data" >/dev/null; as "$admin" GET /v1/jobs; expect 401
unbaked token revoke wall --data "$data" >/dev/null; call GET /v1/jobs; expect 401 "when no token is left"

# --- wrong tokens: logged with their address, throttled, and nobody else with them ---
carl=$(unbaked token add carl --data "$data")
wrong=unbake_4_000000000000000000000000000000000000000000000000
from() { local address=$1; shift; as "$@" -H "X-Forwarded-For: 192.0.2.99, $address"; }
[ "$(awk '/login failed/ && /127.0.0.1/' "$work/log" | wc -l)" -ge 4 ] || fail "failed logins of before: $(grep login "$work/log")"
# By one process at a time, and then three times: every 2 s one more is taken for a mistake, and a process may take as
# long on a machine at work.
throttled() { "$@"; rejected=$((rejected + $(grep -o 401 <<<"$status" | wc -l))); status=${status: -3}; expect 429 "$1"; }
rejected=20
found=$(curl -sS -m 60 -o "$work/body" -w '%{http_code}\n' -H "Authorization: Bearer $wrong" \
    -H "X-Forwarded-For: 192.0.2.99, 192.0.2.1" "$url/v1/jobs?limit=[1-24]" | sort | uniq -c | xargs)
equal "$found" "20 401 4 429" "24 wrong tokens"
throttled from 192.0.2.1 "$wrong" GET '/v1/jobs#[1-3]'
[[ $(header retry-after | tail -n 1) =~ ^[12]$ ]] || fail "Retry-After is '$(header retry-after)'"
equal "$(header connection | tail -n 1)" close "Connection of a throttled reply"
equal "$(field .type)" urn:unbake:too-many-tokens "type of a throttled reply"
throttled call POST '/v1/session#[1-3]' -H 'Content-Type: application/json' -H 'X-Forwarded-For: 192.0.2.1' -d "{\"token\":\"$wrong\"}"
from 192.0.2.1 "$carl" GET /v1/jobs; expect 200 "a good token, from the same address"
call POST /v1/session -H 'Content-Type: application/json' -H 'X-Forwarded-For: 192.0.2.1' -d "{\"token\":\"$carl\"}"; expect 200 "a login, from there"
from 192.0.2.2 "$wrong" GET /v1/jobs; expect 401 "another address"
from 192.0.2.1 "$carl" POST /v1/jobs/7/cancel; expect 404
lines() { jq -s "[.[] | select((.msg | startswith(\"login failed\")) and .client == \"192.0.2.1\") | .msg | contains(\"more of them\") | select(. == $1)] | length" "$work/log"; }
equal "$(lines false)" "$rejected" "lines of that address"
[ "$(lines true)" -ge 1 ] || fail "no line says that more of them are not logged"
jq -se 'any(.msg == "answered" and .user == "carl" and .client == "192.0.2.1")' "$work/log" >/dev/null || fail "no address of the client in the log"
grep -qF "$wrong" "$work/log" && fail "a token is in the log"
unbaked token revoke carl --data "$data" >/dev/null

# --- tokens that end: over HTTP by admins, and what their holders are told ---
ada=$(unbaked token add ada --role admin --expires 2d --data "$data")
as "$ada" GET /v1/session; [[ $(field .expires_at) == 20*Z ]] || fail "the session ends at $(field .expires_at)"
until=$(field .expires_at)
make() { as "$1" POST /v1/tokens -H 'Content-Type: application/json' --data-binary "$(json "$2")"; }
make "$ada" '{"user":"carl"}'; expect 403 "a token that lasts longer than its maker's"; [[ $(field .detail) == *"$until"* ]] || fail "$(field .detail)"
make "$ada" '{"user":"7up","expires_at":"'"$until"'"}'; expect 422
make "$ada" '{"name":"carl","role":"king","expires_at":"2020-01-31T00:00:00Z"}'; expect 422
equal "$(field '[.invalid_params[].name] | sort | join(" ")')" "expires_at name role user" "faults of a token"
make "$ada" '{"user":"carl","role":"viewer","expires_at":"'"$(date -u -d '+4 seconds' +%FT%TZ)"'"}'; expect 201
carl=$(field .token) number=$(field .id)
[[ $carl =~ ^unbake_${number}_[0-9a-f]{48}$ ]] || fail "the token is '$carl'"
as "$carl" GET /v1/tokens; expect 403
curl -sS -m 60 -N -H "Authorization: Bearer $carl" "$url/v1/events" >"$work/stream" & stream=$!
expired() { as "$carl" GET /v1/jobs; [ "$status" = 401 ]; }
wait_for 60 expired
equal "$(field .type)" urn:unbake:token-expired "type of the reply to an expired token"
[[ $(field .detail) == "the token expired at 20"* ]] || fail "an expired token is told: $(field .detail)"
for i in $(seq 24); do as "$carl" GET /v1/jobs; expect 401 "an expired token for the ${i}th time"; done
wait "$stream" || fail "the stream of an expired token goes on"
call POST /v1/session -H 'Content-Type: application/json' -d "{\"token\":\"$carl\"}"; expect 401; equal "$(field .type)" urn:unbake:token-expired
as "$ada" GET /v1/tokens; equal "$(field '[.items[] | select(.expired)] | length')" 1 "expired tokens"
grep -qF "${carl#unbake_*_}" "$work/body" && fail "the list of tokens has secrets"
unbaked token list --data "$data" | grep -q "carl .*, is past" || fail "$(unbaked token list --data "$data")"
unbaked doctor --data "$data" 2>&1 | grep -q '2, 1 of them expired' || fail "doctor: $(unbaked doctor --data "$data" 2>&1 | grep tokens)"
as "$ada" GET /v1/users; equal "$(field '[.items[].name] | join(" ")')" "ada alice carl wall" users
equal "$(field '.items[] | select(.name == "alice") | .kept_bytes > 0 and .jobs == 0')" true "what alice keeps"
as "$ada" DELETE "/v1/tokens/$number"; expect 204; as "$ada" DELETE "/v1/tokens/$number"; expect 404
as "$ada" DELETE /v1/tokens/ada; expect 404
unbaked token revoke ada --data "$data" >/dev/null

# --- backup ---
equal "$(unbaked backup "$work/copy.db" --data "$data" | cut -d: -f1)" "$work/copy.db" "what backup prints"
equal "$(stat -c %a "$work/copy.db")" 600 "mode of a backup"
equal "$(sqlite3 "$work/copy.db" "PRAGMA integrity_check; SELECT count(*) FROM users")" $'ok\n4' "the backup"
before=$(sha256sum <"$work/copy.db")
refused 1 'is there already' unbaked backup "$work/copy.db" --data "$data"
equal "$(sha256sum <"$work/copy.db")" "$before" "a backup that is there already"
ln -s nowhere "$work/link.db"; refused 1 'is there already' unbaked backup "$work/link.db" --data "$data"
equal "$(ls "$work" | grep -c part)" 0 "parts of backups"
equal "$(find "$data/trash" -type f)" "" "left in trash/"
refused 1 'cannot create' unbaked backup /proc/nowhere/file --data "$data"
refused 2 'usage' unbaked backup --data "$data"
tail -n 3 "$work/log" | jq -e '.level and .msg and .time' >/dev/null || fail "the log is no JSON: $(tail -n 3 "$work/log")"
jq -se 'any(.msg == "answered" and .user == "alice" and .status == 201 and .method == "POST" and .request)' \
    "$work/log" >/dev/null || fail "no line for the upload: $(grep answered "$work/log")"
unbaked doctor --data "$data" --set min_free_mib=1 >"$work/out" || fail "doctor: $(cat "$work/out")"
grep -q 'a daemon runs' "$work/out" || fail "doctor: $(cat "$work/out")"
stop_daemon
mkdir "$work/restored"; cp "$work/copy.db" "$work/restored/state.db"
equal "$(unbaked token list --data "$work/restored" | wc -l)" 1 "a restored database"

# --- addresses ---
refused 1 'there are no tokens' "$build/unbaked" --data "$work/fresh" --listen 0.0.0.0:0
refused 1 'there are no tokens' "$build/unbaked" --data "$work/fresh" --listen '[::]:0'
refused 2 'access must be' "$build/unbaked" --data "$work/fresh" --set access=nobody
refused 2 'go together' "$build/unbaked" --data "$work/fresh" --set tls_key=x
refused 1 'access = open is for loopback' "$build/unbaked" --data "$work/fresh" --set access=open --listen 0.0.0.0:0
unbaked doctor --data "$work/fresh" --set listen=0.0.0.0:1 >"$work/out"; equal $? 1 "doctor's exit status"
grep -q '^FAIL *tokens' "$work/out" || fail "doctor: $(cat "$work/out")"
data=$work/open start_daemon --set access=tokens --listen 0.0.0.0:0
call GET /v1/jobs; expect 401 "access = tokens without any"
grep -q 'warning: without tls_certificate, tokens and scenes cross the network unencrypted' "$work/log" || fail "no warning without TLS"
stop_daemon
data=$work/open2; mkdir "$data"; unbaked token add eve --data "$data" >/dev/null
start_daemon --set access=open --set log_format=logfmt
call GET /v1/jobs; expect 200 "access = open"
stop_daemon
tail -n 1 "$work/log" | grep -qE '^time=\S+Z level=info msg="stopped"$' || fail "logfmt: $(tail -n 1 "$work/log")"

# --- doctor ---
doctor() { # WANTED-STATUS "VERDICT NAME PART" OPTION...
    local wanted=$1 line=$2
    shift 2
    unbaked doctor "$@" >"$work/out"
    equal $? "$wanted" "doctor's exit status with $*"
    grep -qE "^$line" "$work/out" || fail "doctor $*: no line '$line': $(cat "$work/out")"
}
mkdir -m 755 "$work/others"; mkdir -m 750 "$work/damaged"; echo 'this is no database' >"$work/damaged/state.db"
doctor 0 'warn +data .* is not there' --data "$work/none"
doctor 0 'warn +sandbox .*sandbox = no' --data "$work/none" --set sandbox=no
doctor 0 'warn +machine .*more memory than there is' --data "$work/none" --set worker_memory_mib=16777216
doctor 0 'warn +data .*chmod go=' --data "$work/others" --set min_free_mib=1
doctor 1 'FAIL +disk' --data "$work/others" --set min_free_mib=16777216
doctor 1 'FAIL +database .*damaged' --data "$work/damaged" --set min_free_mib=1
doctor 0 'ok +libraries .*gnutls [0-9].*sqlite [0-9].*libjpeg [0-9].*zlib [0-9].*libtiff [0-9.]+, .*libexpat [0-9].*libunistring [0-9].*libseccomp [0-9]' --data "$work/none"
doctor 0 'ok +tokens .*open: .*may do everything' --data "$work/none" --set access=open
doctor 1 'FAIL +tokens .*loopback addresses only' --data "$work/none" --set access=open --set listen=0.0.0.0:1
unbaked token revoke ada --data "$work/first" >/dev/null; doctor 0 "warn +tokens .*1, none of them an admin's" --data "$work/first"
doctor 1 'warn +tls .*unencrypted' --data "$work/none" --set listen=0.0.0.0:1
cp /etc/hostname "$work/nokey"
doctor 1 'FAIL +tls .*private key' --data "$work/none" --set tls_certificate="$work/nokey" --set tls_key="$work/nokey"
doctor 1 'FAIL +tls' --data "$work/none" --set tls_certificate="$work/none" --set tls_key="$work/none"
doctor 0 'usage: unbaked doctor' --help
(ulimit -n 500; exec "$build/unbaked" doctor --data "$work/none") >"$work/out"
grep -qE '^warn +limits .*wanted for max_connections' "$work/out" || fail "doctor with few files: $(cat "$work/out")"
unbaked doctor word >"$work/out"; equal $? 2 "doctor's exit status with a word"

# --- check-config ---
unbaked check-config config/unbaked.conf >/dev/null || fail "check-config: $(cat "$work/err")"
printf 'max_runing = 1\nlog_format = xml\n' >"$work/bad.conf"
refused 2 'did you mean max_running' unbaked check-config "$work/bad.conf"
grep -q 'bad.conf:2: log_format must be text, logfmt or json' "$work/err" || fail "$(cat "$work/err")"
equal "$(grep -vc "^$work/bad.conf:[12]: " "$work/err")" 0 "problems without a line"

# --- TLS ---
certificate() {
    openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj "/CN=$1" \
        -addext 'subjectAltName=IP:127.0.0.1' -keyout "$work/key.pem" -out "$work/cert.pem" 2>/dev/null
}
if command -v openssl >/dev/null; then
    certificate first; cp "$work/cert.pem" "$work/first.pem"
    data=$work/tls
    start_daemon --set tls_certificate="$work/cert.pem" --set tls_key="$work/key.pem" --set max_upload_mib=1 \
        --set keepalive_sec=1
    url=https://${url#http://}
    equal "$(cat "$work/stdout")" "$url" "what it prints"
    call GET /healthz --cacert "$work/first.pem"; expect 200 "over TLS"
    call GET /healthz; equal "$status" 000 "with an unknown certificate"
    head -c 300000 /dev/urandom >"$work/junk"
    call POST /v1/scenes --cacert "$work/first.pem" -T "$work/junk"; expect 201 "an upload over TLS"
    # A refusal in the middle of a body goes past the library, but into the session.
    head -c 3000000 /dev/zero | curl -sS -m 60 --cacert "$work/first.pem" -X POST -T - -H 'Transfer-Encoding: chunked' \
        -o "$work/body" -w '%{http_code}' "$url/v1/scenes" >"$work/out" 2>/dev/null
    equal "$(cat "$work/out")" 413 "a refusal in the middle of a body"
    openssl req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=rsa -keyout "$work/key.pem" -out "$work/cert.pem" 2>/dev/null
    kill -HUP "$daemon_pid"; wait_for 60 grep -q 'certificate was read again' "$work/log"
    suite() { openssl s_client -connect "${url#https://}" "$@" </dev/null 2>/dev/null | sed -n 's/^ *Cipher *: *//p' | head -n 1; }
    for refused in "kRSA:@SECLEVEL=0" "ECDHE-RSA-AES256-SHA:@SECLEVEL=0" "DHE-RSA-AES128-SHA:@SECLEVEL=0" "AES256-SHA:@SECLEVEL=0"; do
        [[ $(suite -tls1_2 -cipher "$refused") =~ ^(0000)?$ ]] || fail "TLS 1.2 with $refused is taken: $(suite -tls1_2 -cipher "$refused")"
    done
    equal "$(suite -tls1_2 -cipher ECDHE-RSA-AES128-GCM-SHA256)" ECDHE-RSA-AES128-GCM-SHA256 "the suite of TLS 1.2"
    [[ $(suite -tls1_1 -cipher ALL:@SECLEVEL=0) =~ ^(0000)?$ ]] || fail "TLS 1.1 is taken"
    mv "$work/first.pem" "$work/old.pem"; certificate first; cp "$work/cert.pem" "$work/first.pem"
    kill -HUP "$daemon_pid"; wait_for 60 eval '[ "$(grep -c "certificate was read again" "$work/log")" -ge 2 ]'
    echo broken >"$work/key.pem"; kill -HUP "$daemon_pid"
    wait_for 60 grep -q 'the old certificate stays' "$work/log"
    call GET /healthz --cacert "$work/first.pem"; expect 200 "after a bad reload"
    certificate second; kill -HUP "$daemon_pid"
    chmod 644 "$work/key.pem"
    doctor 0 'warn +tls .*everybody here can read the key' --data "$data" --set min_free_mib=1 \
        --set tls_certificate="$work/cert.pem" --set tls_key="$work/key.pem"
    wait_for 60 eval '[ "$(grep -c "certificate was read again" "$work/log")" -ge 3 ]'
    call GET /healthz --cacert "$work/cert.pem"; expect 200 "the new certificate"
    call GET /healthz --cacert "$work/first.pem"; equal "$status" 000 "the old certificate, after a reload"
    unbaked doctor --data "$data" --set min_free_mib=1 --set tls_certificate="$work/cert.pem" --set tls_key="$work/first.pem" \
        >"$work/out" && fail "doctor takes a certificate for a key"
    curl -sN -m 60 --cacert "$work/cert.pem" "$url/v1/events" >"$work/stream" & background=$!
    wait_for 60 grep -q keepalive "$work/stream"
    stop_daemon # with the stream open
    equal "$daemon_status" 0 "exit status with TLS"
    wait "$background"
    background=
    refused 1 'key.pem' "$build/unbaked" --data "$data" --listen 127.0.0.1:0 \
        --set tls_certificate="$work/first.pem" --set tls_key="$work/key.pem"
fi

# --- what is made from the tables ---
for page in unbaked.8 unbaked.conf.5; do
    unbaked manual "$page" >"$work/$page" || fail "manual $page"
    grep -q '^\.TH UNBAKED' "$work/$page" || fail "$page has no title"
    [ -z "$(command -v man)" ] || equal "$(man --warnings -l "$work/$page" 2>&1 >/dev/null)" "" "warnings of man for $page"
done
for name in $(sed -n 's/^\([a-z_]*\) =.*/\1/p' config/unbaked.conf); do
    grep -q "fB$name" "$work/unbaked.conf.5" || fail "unbaked.conf.5 has no $name"
done
complete_with() { # PROGRAM WORD...: what bash would offer for the last word
    bash -c '. "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); "_$1"; echo "${COMPREPLY[*]}"' - "$work/$1.bash" "$@"
}
unbaked manual bash >"$work/unbaked.bash"
equal "$(complete_with unbaked tok)" token "completion of a command"
equal "$(complete_with unbaked token rev)" revoke "completion of a word"
equal "$(complete_with unbaked token add x --role v)" viewer "completion of a value"
equal "$(complete_with unbaked --set max_run)" max_running= "completion of an option"
unbaked manual zsh | head -n 1 | grep -qx '#compdef unbaked' || fail "zsh"
refused 2 usage unbaked manual nothing
finish
