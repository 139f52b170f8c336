#!/bin/bash
# A webhook's message by TLS, to a server whose certificate the system trusts, from inside the sandbox: the name is
# resolved, the trusted certificates read, the handshake done. And a certificate that nobody trusts is refused. In a mount
# namespace, where the system's trust can be another.
set -u
command -v openssl >/dev/null || { echo "there is no openssl"; exit 77; }
[ "${UNBAKE_IN_NAMESPACE:-}" ] || { unshare -m true 2>/dev/null || { echo "no mount namespaces for this user"; exit 77; }
    UNBAKE_IN_NAMESPACE=1 exec unshare -m bash "$0" "$@"; }
. tests/api/lib.sh "$@"
trust=/etc/ssl/certs/ca-certificates.crt
[ -e "$trust" ] && [ -e /etc/hosts ] || { echo "there is no $trust or no /etc/hosts"; exit 77; }

openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN=hook.test \
    -addext subjectAltName=DNS:hook.test -keyout "$work/key" -out "$work/cert" 2>/dev/null
{ cat /etc/hosts; echo "127.0.0.1 hook.test"; } >"$work/hosts"
mount --bind "$work/hosts" /etc/hosts || exit 1

serve() {
    { printf 'HTTP/1.1 204 No Content\r\n\r\n'; sleep 20; } |
        openssl s_server -quiet -naccept 1 -accept 127.0.0.1:"$1" -key "$work/key" -cert "$work/cert" >"$work/got" 2>&1 &
    background=$!
    wait_for 20 grep -q "^ *[0-9]*: 0100007F:$(printf %04X "$1") .* 0A " /proc/net/tcp
}
# deliver URL: its worker's exit status; what it says goes to $work/said.
deliver() {
    mkdir -p "$work/message"
    printf '{"kind":"deliver","url":"%s","secret":"a-secret-of-sixteen-bytes","body":"{\\"a\\":1}","message_id":"msg_1","allow_private":true,"sandbox":true}' \
        "$1" >"$work/message/job.json"
    "$build/unbaked" worker "$work/message" 3>"$work/said" 2>>"$work/log"
}
free=$((20000 + $$ % 12000)) # below the ports that the system gives out itself

serve "$free"
deliver "https://hook.test:$free/x"
equal $? 1 "a certificate that nobody trusts: exit status"
grep -q 'TLS with hook.test: .*certificate' "$work/said" || fail "it said: $(cat "$work/said")"
grep -q 'sandbox: TCP to one port, no new programs, nothing is writable' "$work/said" || fail "it said: $(cat "$work/said")"
kill "$background" 2>/dev/null

mount --bind "$work/cert" "$trust" || exit 1
free=$((free + 1))
serve "$free"
deliver "https://hook.test:$free/x"
equal $? 0 "exit status"
wait_for 20 grep -q '{"a":1}' "$work/got"
grep -q '"status":"ok"' "$work/said" || fail "it said: $(cat "$work/said")"
finish
