#!/bin/bash
# What scripts use: wait, formats, servers with names, open, version -v, tables as wide as the terminal; and the program
# of client/README.md, as it stands there.
. tests/api/client.sh "$@"
export XDG_CONFIG_HOME=$work/config
unset UNBAKE_TOKEN UNBAKE_CA BROWSER DISPLAY WAYLAND_DISPLAY
so() { jq -e "$1" <<<"$out" >/dev/null 2>&1 || fail "not so: $1: $out"; }

make_room "$work/room"
daemon_start

# --- wait ----------------------------------------------------------------------------------------

run 0 submit "$work/room" $tiny --name first -q
run 0 submit "$work/room" $tiny --name second -q
run 0 wait 1 2 1 -q
equal "$(sort <<<"$out")" "1 succeeded"$'\n'"2 succeeded"
run 0 wait last
has "$out" "job 2 succeeded"
run 0 wait 1 2 --json
all=$out
for form in "-o json" "--format json"; do
    # shellcheck disable=SC2086
    run 0 wait 1 2 $form
    equal "$out" "$all" "wait $form"
done
equal "$(jq -s -c 'map([.id, .state])' <<<"$out")" '[[1,"succeeded"],[2,"succeeded"]]'
run 0 submit "$work/room" $endless -q
run 9 wait 3 --timeout 0.2 -q
run 0 wait 3 2 --any -q
equal "$out" "2 succeeded"
env --default-signal=INT "$build/unbake" wait 3 >/dev/null 2>"$work/err" &
interrupt $!
equal $? 130 "exit status of a wait after Ctrl-C"
has "$(cat "$work/err")" "the jobs continue"
"$build/unbake" wait 1 3 >"$work/out" 2>&1 & background=$!
wait_for 60 job_is 3 running
run 0 cancel 3
wait "$background"; equal $? 8 "exit status when a job was cancelled: $(cat "$work/out")"
background=
run 3 wait 1 99
run 2 wait
run 2 wait one
daemon_end TERM
# A job that fails: its worker cannot use what the memory limit leaves. (Sanitizers take memory without asking.)
case $build in
*/asan | */tsan) ;;
*)
    daemon_start --set worker_memory_mib=16
    run 0 submit "$work/room" $tiny --name fails -q
    run 1 wait last 1
    has "$out" "job 4 failed"
    daemon_end TERM
    ;;
esac
run 5 wait 1 --retry 0.2
daemon_start

# --- formats -------------------------------------------------------------------------------------

run 0 list -o json
so 'length == 4 and .[0].id == 4'
json=$out
run 0 list --format json
equal "$out" "$json"
run 0 list --json
equal "$out" "$json"
run 0 list -o jsonl
equal "$(jq -s -c . <<<"$out")" "$(jq -c . <<<"$json")"
equal "$(wc -l <<<"$out")" 4 "lines of jsonl"
run 0 list --format=text
has "$out" "first"
run 2 list -o jsnl
has "$err" "did you mean json"
run 2 list --json -o text
run 2 list --stat -o json
jq -e '.exit_status == 2' <<<"$err" >/dev/null || fail "no JSON: $err"
run 3 show 99 -o jsonl
jq -e '.exit_status == 3' <<<"$err" >/dev/null || fail "no JSON: $err"
# What is documented is there, of every command that lists or shows something.
keys() { # COMMAND...
    sed -n "s/^| \`[^|]*$1\`[^|]*|[^|]*|\(.*\)|\$/\1/p" client/README.md | sed 's/([^)]*)//g; s/; .*//' | grep -oE '`[a-z_0-9]+`' | tr -d '`'
}
scene=$(jq -r '.[0].scene' <<<"$json")
for command in "list" "show 1" "wait 1" "scenes" "scenes show $scene" "check --scene $scene" settings version servers "open 1"; do
    run 0 $command --json
    documented=$(keys "${command%% *}")
    [ -n "$documented" ] || fail "client/README.md has no keys of $command"
    for key in $documented; do
        jq -e --arg key "$key" '(if type == "array" then .[0] else . end) | (has($key) or (.client? // {} | has($key)))' <<<"$out" >/dev/null ||
            fail "$command has no $key: $(head -c 300 <<<"$out")"
    done
done
for command in list show scenes uploads settings servers version collect check; do
    run 0 "$command" --help
    has "$out" "-o, --format FORMAT"
done

# --- servers -------------------------------------------------------------------------------------

there=$UNBAKE_SERVER
unset UNBAKE_SERVER
mkdir -p "$XDG_CONFIG_HOME/unbake"
config=$XDG_CONFIG_HOME/unbake/config
printf 'server = lab # mine\n\n[lab]\nurl = %s/\n[away]\nurl = http://127.0.0.1:1\n' "$there" >"$config"
run 0 list -q
run 0 list -q --server lab
run 5 list --server away --retry 0
UNBAKE_SERVER=away run 5 list --retry 0
run 2 list --server awy
has "$err" "did you mean away?"
run 0 servers -o json
so 'map([.name, .in_use, .token]) == [["lab", true, "none"], ["away", false, "none"]]'
run 0 servers --server "$there"
has "$out" "lab"
run 2 servers --server nobody
has "$out" "lab"
ada=$("$build/unbaked" token add ada --role admin --data "$data" 2>/dev/null)
run 4 list
echo "token_file = away.token" >>"$config"
sed -i "s|^url = $there/|&\ntoken_file = lab.token|" "$config"
run 7 list
echo "$ada" >"$XDG_CONFIG_HOME/unbake/lab.token"
chmod 640 "$XDG_CONFIG_HOME/unbake/lab.token"
run 7 list
has "$err" "chmod 600"
chmod 600 "$XDG_CONFIG_HOME/unbake/lab.token"
run 0 list -q
run 0 servers -o jsonl
equal "$(jq -r .token <<<"$out" | tr '\n' ' ')" "file unreadable "
run 4 list --server "$there"
echo "two words" >"$XDG_CONFIG_HOME/unbake/lab.token"
run 2 list
has "$err" "does not hold a token"
echo "$ada" >"$XDG_CONFIG_HOME/unbake/lab.token"
chmod 622 "$config"
run 7 list
has "$err" "can be written by others"
chmod 600 "$config"
cp "$config" "$work/good"
wrong() { # MESSAGE CONTENT
    printf "$2" >"$config"
    run 2 list
    has "$err" "$1"
}
wrong 'line 2: "nonsense" is neither' '# x\nnonsense\n'
wrong 'did you mean url?' '[a]\nurk = http://x\n'
wrong 'line 1: unknown name "url"' 'url = http://x\n'
wrong '[a] has no url' '[a]\nca = x\n'
wrong 'there is a [a] above' '[a]\nurl = http://x\n[a]\n'
wrong 'line 1: [NAME] has' '[a b]\n'
wrong 'url has no value' '[a]\nurl =\n'
wrong 'no server is named "b"' 'server = b\n[a]\nurl = http://x\n'
cp "$work/good" "$config"

# --- open, version -------------------------------------------------------------------------------

run 0 open last
equal "$out" "$there/#job=4"
has "$err" "no browser"
printf '#!/bin/sh\necho noise\necho "$1" >"%s"\n' "$work/opened" >"$work/browser"
chmod +x "$work/browser"
BROWSER=$work/browser run 0 open 1
equal "$out" "$there/#job=1"
equal "$(cat "$work/opened")" "$there/#job=1" "what the browser shows"
rm "$work/opened"
BROWSER=$work/browser run 0 open 1 --print
[ ! -e "$work/opened" ] || fail "--print has opened a browser"
run 0 open --json
so '.url == "'"$there"'/" and .opened == false'
BROWSER=false run 0 open --json
so '.opened == false'
run 3 open 99
run 2 open --server unix:/nowhere
run 0 version -v
has "$out" "  libarchive"
has "$out" "  sqlite"
equal "$(grep -c '  API  *v1' <<<"$out")" 2 "API versions"
run 0 version -v --server http://127.0.0.1:1 --retry 0
has "$out" "cannot reach"

# --- as wide as the terminal ---------------------------------------------------------------------

screen() { # COLUMNS ARGUMENT...
    local columns=$1
    shift
    TERM=xterm NO_COLOR=1 script -qec "stty cols $columns; $build/unbake $*" /dev/null </dev/null | tr -d '\r'
}
run 0 edit 1 --name "a name that is far longer than what is left for it beside the columns of a list"
for columns in 120 80 60 48; do
    for command in list scenes settings servers; do
        widest=$(screen "$columns" "$command" | awk '{ if (length > most) most = length } END { print most }')
        [ "$widest" -le "$columns" ] || fail "$command: $widest columns on a terminal of $columns: $(screen "$columns" "$command" | head -n 3)"
    done
done
has "$(screen 120 list | head -n 1)" "expires"
[[ $(screen 48 list | head -n 1) != *expires* ]] || fail "a narrow list has all columns"
run 0 list
has "$out" "beside the columns of a list"

# --- the program of client/README.md --------------------------------------------------------------

python=python3
if ! python3 -c 'import requests' 2>/dev/null; then # Debian's python3-requests, else PyPI's
    python=build/requests/bin/python
    [ -x "$python" ] || python3 -m venv build/requests >/dev/null 2>&1
    "$python" -c 'import requests' 2>/dev/null || timeout 120 build/requests/bin/pip install -q requests==2.32.3 >/dev/null 2>&1
fi
python=$(command -v "$python") && python=$(realpath -s "$python")
if [ -n "$python" ] && "$python" -c 'import requests' 2>/dev/null; then
    sed -n '/^```python$/,/^```$/p' client/README.md | sed '1d; $d' |
        sed 's/{"texture_size": 512, "quality": "draft"}/{"texture_size": 64, "texels_per_metre": 2, "gather_samples": 16, "gloss_passes": 1, "iterations": 3, "texels_per_iteration": 64, "report_samples": 1}/' >"$work/room.py"
    (cd "$work" && UNBAKE_SERVER=$there UNBAKE_TOKEN=$ada "$python" room.py room textures views >room.log 2>&1) ||
        fail "the program of client/README.md fails: $(tail -n 5 "$work/room.log")"
    [ -s "$work/textures/base_color.exr" ] && [ -s "$work/textures/preview/base_color.png" ] || fail "no textures: $(ls "$work/textures")"
    compgen -G "$work/views/*.png" >/dev/null || fail "no view: $(ls "$work/views")"
    has "$(cat "$work/room.log")" "job 6: "
    (cd "$work" && UNBAKE_SERVER=$there UNBAKE_TOKEN=wrong "$python" room.py room textures views >room.log 2>&1) &&
        fail "a wrong token is taken"
    has "$(cat "$work/room.log")" "/v1/scenes: "
else
    echo "the program of client/README.md is not run: there is no requests for Python"
fi
finish
