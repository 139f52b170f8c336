#!/bin/bash
# The client with tokens: login, the file that keeps them, sharing, TLS; its manual and completion.
. tests/api/client.sh "$@"

export XDG_CONFIG_HOME=$work/config
unset UNBAKE_TOKEN UNBAKE_CA
tokens=$XDG_CONFIG_HOME/unbake/tokens

daemon_start
run 4 login <<<"unbake_1_nothing"
has "$err" "rejects this token"
alice=$("$build/unbaked" token add alice --role user --data "$data" 2>/dev/null)
vic=$("$build/unbaked" token add vic --role viewer --data "$data" 2>/dev/null)
run 4 list
has "$err" "asks for a token"
run 2 login </dev/null
has "$err" "no token was given"
run 4 login <<<"${alice}0"
[ ! -e "$tokens" ] || fail "a wrong token was kept"
umask 000
run 0 login <<<"$alice"
umask 022
has "$out" "alice at $UNBAKE_SERVER, role user"
equal "$(stat -c %a "$tokens")" 600 "mode of the file"
equal "$(cat "$tokens")" "$UNBAKE_SERVER $alice" "the file"
run 0 list

# --- sharing ---
make_room "$work/room"
run 0 submit "$work/room" $endless
run 0 show 1 --json
jq -e '.owner == "alice" and .shared == false' <<<"$out" >/dev/null || fail "$out"
UNBAKE_TOKEN=$vic run 3 show 1
UNBAKE_TOKEN=$vic run 0 list -q --json
equal "$out" "[]" "what a viewer sees"
run 0 edit 1 --share
UNBAKE_TOKEN=$vic run 0 show 1
has "$out" alice
UNBAKE_TOKEN=$vic run 0 list
equal "$(head -n 1 <<<"$out" | tr -s " ")" "job state done stage left age expires owner name" "the headings of a list"
UNBAKE_TOKEN=$vic run 0 logs 1
UNBAKE_TOKEN=$vic run 4 cancel 1
has "$err" "may only read"
run 0 edit 1 --unshare
UNBAKE_TOKEN=$vic run 3 show 1
run 0 submit --scene "$(unset out; run 0 show 1 --json; jq -r .scene <<<"$out")" $endless --share
UNBAKE_TOKEN=$vic run 0 show 2
# A watch under way ends when its token is revoked.
"$build/unbake" watch 2 --retry 20 >"$work/watch" 2>&1 & background=$!
wait_for 60 test -s "$work/watch"
"$build/unbaked" token revoke alice --data "$data" >/dev/null 2>&1
wait "$background"; equal $? 4 "exit status of a watch whose token was revoked: $(tail -n 2 "$work/watch")"
background=
run 4 list
has "$err" "invalid or was revoked"
UNBAKE_TOKEN=$'unbake_1\nx' run 2 list
has "$err" "UNBAKE_TOKEN is not a token"

# --- the file ---
run 0 logout
equal "$(cat "$tokens")" "" "the file after logout"
run 0 logout
has "$err" "no token is kept"
printf 'http://other.example:1 unbake_9_x\n%s bad\n' "$UNBAKE_SERVER" >"$tokens"
ada=$("$build/unbaked" token add ada --role admin --data "$data" 2>/dev/null)
run 0 login -q <<<"$ada"
equal "$(cat "$tokens")" "http://other.example:1 unbake_9_x"$'\n'"$UNBAKE_SERVER $ada" "the file with two servers"
run 0 cancel 1 2
chmod 640 "$tokens"
run 7 list
has "$err" "chmod 600 $tokens"
UNBAKE_TOKEN=$ada run 0 list
chmod 600 "$tokens"
daemon_end TERM

# --- TLS ---
if command -v openssl >/dev/null; then
    openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN=lab \
        -addext 'subjectAltName=IP:127.0.0.1' -keyout "$work/key.pem" -out "$work/cert.pem" 2>/dev/null
    daemon_start --set tls_certificate="$work/cert.pem" --set tls_key="$work/key.pem"
    export UNBAKE_SERVER=https://${UNBAKE_SERVER#http://}
    run 5 list --retry 0
    has "$err" "--ca FILE"
    run 0 login --ca "$work/cert.pem" <<<"$ada"
    UNBAKE_CA=$work/cert.pem run 0 submit "$work/room" $endless --name again
    UNBAKE_CA=$work/cert.pem run 0 cancel last
    daemon_end TERM
fi

# --- manual and completion ---
run 0 manual unbake.1
echo "$out" >"$work/unbake.1"
[ -z "$(command -v man)" ] || equal "$(man --warnings -l "$work/unbake.1" 2>&1 >/dev/null)" "" "warnings of man"
run 0 manual bash
echo "$out" >"$work/unbake.bash"
offered() { # what bash would offer for the last word
    bash -c '. "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _unbake; echo "${COMPREPLY[*]}"' - "$work/unbake.bash" unbake "$@"
}
equal "$(offered sub)" submit "completion of a command"
equal "$(offered submit --wat)" --watch "completion of an option"
equal "$(offered submit --set texture_)" texture_size= "completion of a setting"
equal "$(offered check --scene-set mesh_)" mesh_axes= "completion of how a scene is read"
equal "$(offered list --state fail)" failed "completion of a state"
run 2 manual nothing
finish
