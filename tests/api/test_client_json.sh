#!/bin/bash
# With --json, whatever goes wrong is told as one JSON object on stderr, and nothing else is there.
. tests/api/client.sh "$@"
export XDG_CONFIG_HOME=$work/config
unset UNBAKE_TOKEN UNBAKE_CA

# is_problem STATUS WHAT: $err is one object with title, detail and exit_status, $out is empty.
is_problem() {
    jq -es --argjson status "$1" 'length == 1 and (.[0] | .exit_status == $status and (.title | length > 0)
        and (.detail | length > 0))' <<<"$err" >/dev/null 2>&1 || fail "$2: no problem of status $1: $err"
    equal "$out" "" "stdout of $2"
}
problem() {
    run "$@"
    is_problem "$1" "unbake ${*:2}"
}

daemon_start
problem 2 sumbit --json
has "$(jq -r .hint <<<"$err")" 'did you mean "submit"?'
problem 2 --json sumbit
problem 2 --json
problem 2 help sumbit --json
problem 2 list --jsno --json
problem 2 list --json --jsno
problem 2 --server http://x list --json --limit
problem 2 list --limit many --json
problem 2 list --json --server
problem 2 show --json
problem 2 show 1 2 --json
problem 2 show one --json
problem 2 list --state quued --json
problem 2 settings textur_size --json
problem 2 submit --json
problem 2 scenes frobnicate x --json
problem 2 manual nothing --json
problem 2 edit 1 --json
problem 2 extend 1 --json
problem 2 list --server ftp://127.0.0.1 --json
problem 2 list --server 'http://a b/' --json
problem 2 login --json </dev/null
problem 2 submit "$work" --set novalue --json
problem 2 submit "$work/nothing-here" --json
UNBAKE_TOKEN='a b' problem 2 list --json
problem 3 show 99 --json
problem 3 scenes show 00000000 --json
problem 3 get 99 --json
problem 3 watch 99 --json
problem 4 submit --scene 00000000 --json
equal "$(jq -r '.invalid_params[0].name' <<<"$err")" scene "what the daemon says"
problem 4 login --json <<<unbake_1_nothing
problem 5 list --server https://127.0.0.1:"$port" --retry 0 --json
problem 5 list --server http://127.0.0.1:1 --retry 0 --json
problem 5 list --server http://nowhere.invalid --retry 0 --json
problem 5 list --ca /nonexistent --server https://127.0.0.1:"$port" --retry 0 --json
# After "--" it is a word, and as an option's value it is none of ours once all is read.
run 2 show -- --json
has "$err" 'unbake: "--json" is not a job'

# The directory where tokens are kept cannot be read, stdout cannot be written.
mkdir -p "$XDG_CONFIG_HOME/unbake/tokens"
problem 7 list --json
rmdir "$XDG_CONFIG_HOME/unbake/tokens"
if [ -e /dev/full ]; then
    "$build/unbake" list --json >/dev/full 2>"$work/err"
    equal $? 7 "exit status on a full disk"
    out= err=$(cat "$work/err")
    is_problem 7 "a full disk"
    has "$err" "standard output"
fi

# Ctrl-C while it reads a token, watches, tries again, sends.
interrupted() {
    env --default-signal=INT "$build/unbake" "$@" --json >"$work/out" 2>"$work/err" < <(sleep 60) &
    interrupt $!
    equal $? 130 "exit status of unbake $* after Ctrl-C"
    out= err=$(cat "$work/err")
    is_problem 130 "unbake $* after Ctrl-C"
}
interrupted login
interrupted list --server http://127.0.0.1:1 --retry 60
truncate -s 4G "$work/large.tar"
interrupted submit "$work/large.tar"
daemon_end TERM
problem 5 list --retry 0 --json
finish
