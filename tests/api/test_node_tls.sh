#!/bin/bash
# A node reaches the daemon by TLS, with a certificate of a private authority that the executor's file names (`ca`), or by a
# unix socket that is forwarded to it: the results are those of a job at home. One that does not trust the certificate, or
# speaks to the wrong port, ends at once and says why; `unbaked executor test` finds it out on the node.
set -u
. tests/api/site.sh "$@"
command -v openssl >/dev/null || { echo "there is no openssl"; exit 77; }
make_room "$work/room"

# An authority, and a certificate of it for this machine's loopback address.
authority() { # NAME
    openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj "/CN=authority $1" \
        -keyout "$work/$1.key" -out "$work/$1.pem" 2>/dev/null
}
authority lab
authority other
openssl req -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -subj /CN=head -keyout "$work/key.pem" \
    -out "$work/request.pem" 2>/dev/null
printf 'subjectAltName=IP:127.0.0.1' >"$work/names"
openssl x509 -req -in "$work/request.pem" -CA "$work/lab.pem" -CAkey "$work/lab.key" -CAcreateserial -days 2 \
    -extfile "$work/names" -out "$work/cert.pem" 2>/dev/null || fail "openssl"

ada=$("$build/unbaked" token add ada --role user --data "$data" 2>/dev/null)
export UNBAKE_TOKEN=$ada UNBAKE_CA=$work/lab.pem
tls="--set tls_certificate=$work/cert.pem --set tls_key=$work/key.pem"
# shellcheck disable=SC2086
daemon_start $tls
daemon_end TERM
url=https://127.0.0.1:$port
mkdir "$work/shared"
for name in secure:lab wrong:other; do
    site_make "${name%:*}" ""
    sed -i "1i ca = $work/${name#*:}.pem\nshared = $work/shared" "$work/executors.d/${name%:*}.conf"
done
url=unix:$work/socket
site_make tunnel ""
# shellcheck disable=SC2086
daemon_start --set executors=process,secure,wrong,tunnel $site_flags $tls
export UNBAKE_SERVER=https://127.0.0.1:$port

# What runs on the node says whether it reaches the daemon.
# shellcheck disable=SC2086
try() { timeout 100 "$build/unbaked" executor test "$1" --data "$work/none" $site_flags >"$work/try-$1" 2>&1; }
try secure &
secure=$!
try wrong &
wrong=$!

submit process 300
await succeeded
run 0 get "$job" -o "$work/home"
submit secure 300
same "by TLS" 1
python3 - "$work/socket" "$port" "$work/lab.pem" <<'PY' &
import asyncio, ssl, sys
path, port, ca = sys.argv[1:]
context = ssl.create_default_context(cafile=ca)
async def move(a, b):
    try:
        while data := await a.read(65536):
            b.write(data)
            await b.drain()
    except OSError:
        pass
    b.close()
async def serve(reader, writer):
    to_reader, to_writer = await asyncio.open_connection("127.0.0.1", int(port), ssl=context)
    await asyncio.gather(move(reader, to_writer), move(to_reader, writer))
async def main():
    await (await asyncio.start_unix_server(serve, path)).serve_forever()
asyncio.run(main())
PY
background=$!
wait_for 60 test -S "$work/socket"
submit tunnel 300
same "by a unix socket" 1

# node EXPECTED URL ARGUMENT...: it ends with 1, at once, and says so.
node() {
    local wanted=$1 code
    shift
    UNBAKE_NODE_TOKEN=none timeout 20 "$build/unbaked" node "$@" --job 1 --attempt 1 >"$work/said" 2>&1
    code=$?
    [ $code = 1 ] && grep -q -- "$wanted" "$work/said" || fail "node $*: $code, $(cat "$work/said")"
}
secure_url=https://127.0.0.1:$port
node 'certificate.*' "$secure_url" --ca "$work/other.pem"
grep -q 'hint: --ca FILE (the key ca of the executor' "$work/said" || fail "no hint: $(cat "$work/said")"
node 'certificate' "$secure_url"
node 'localhost' "https://localhost:$port" --ca "$work/lab.pem" # a name that is not the certificate's
node "$work/absent.pem" "$secure_url" --ca "$work/absent.pem"
node "token" "$secure_url" --ca "$work/lab.pem"

wait $secure || fail "executor test: $(cat "$work/try-secure")"
grep -q "^ok *url .* reaches $secure_url" "$work/try-secure" || fail "executor test: $(cat "$work/try-secure")"
wait $wrong && fail "executor test does not notice that nodes do not trust the certificate"
grep -q "^FAIL *url .*certificate" "$work/try-wrong" || fail "executor test: $(cat "$work/try-wrong")"
[ $failures = 0 ] || cat "$work/nodes.log"
finish
