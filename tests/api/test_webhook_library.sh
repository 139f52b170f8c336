#!/bin/bash
# A message is verified by the reference library of Standard Webhooks, as its receivers do: with a secret as the library
# makes them, and with one of another form, for which the library is given whsec_ and the base64 of its text.
set -u
. tests/api/client.sh "$@"
venv=build/standardwebhooks
[ -x "$venv/bin/python" ] || python3 -m venv "$venv" >"$work/pip" 2>&1
"$venv/bin/python" -c 'import standardwebhooks' 2>/dev/null ||
    timeout 120 "$venv/bin/pip" install -q standardwebhooks==1.0.0 >>"$work/pip" 2>&1 ||
    { echo "the library standardwebhooks cannot be had: $(tail -n 1 "$work/pip")"; exit 77; }

cat >"$work/receive.py" <<'PY'
import http.server, sys
from standardwebhooks.webhooks import Webhook

class Receiver(http.server.BaseHTTPRequestHandler):
    def do_POST(self):
        body = self.rfile.read(int(self.headers["Content-Length"]))
        for secret in sys.argv[2:]:
            try:
                data = Webhook(secret).verify(body, dict(self.headers))
                print("verified", sys.argv.index(secret), data["data"]["state"], flush=True)
            except Exception as e:
                print("refused", sys.argv.index(secret), type(e).__name__, flush=True)
        self.send_response(204)
        self.end_headers()
    def log_message(self, *args):
        pass

server = http.server.HTTPServer(("127.0.0.1", 0), Receiver)
open(sys.argv[1], "w").write(str(server.server_port))
server.serve_forever()
PY
theirs=whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw
ours='a secret of another form'
"$venv/bin/python" "$work/receive.py" "$work/hook-port" "$theirs" "whsec_$(printf %s "$ours" | base64)" >"$work/told" & background=$!
wait_for 60 test -s "$work/hook-port"
make_room "$work/room"
daemon_start --set webhook_private=yes
quick=$tiny
for secret in "$theirs" "$ours"; do
    UNBAKE_WEBHOOK_SECRET=$secret run 0 submit "$work/room" $quick --webhook "http://127.0.0.1:$(cat "$work/hook-port")/" --watch -q
done
wait_for 60 grep -q '^verified 2 succeeded' "$work/told" && wait_for 60 grep -q '^verified 3 succeeded' "$work/told"
equal "$(grep -c '^verified' "$work/told")" 4 "messages that the library verified: $(cat "$work/told")"
stop_daemon
finish
