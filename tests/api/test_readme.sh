#!/bin/bash
# The documents (README.md and those of the folders) against the tree and the programs:
#
# - links between documents, files, functions (file.c:function), targets of make, commands and options that they
#   name are there;
# - README.md's tables of settings, options and exit statuses agree with the tables in the programs; the manual
#   pages have all of them;
# - every block that is marked ```sh is run, in a folder of its own, with a small room and small textures.
set -u
# shellcheck source=tests/api/lib.sh
. tests/api/lib.sh "$@"
build=$(realpath "$build")
document=README.md
say() { fail "$document: $*"; }

documents=$(find . -name '*.md' -not -path './build/*' -not -path './.git/*' | sed 's|^\./||' | sort)
find Makefile client common config deploy server tests -type f >"$work/tree"

# code: what stands in backquotes and in blocks, a line each.
code() {
    awk '/^```/ { block = !block; next }
         block { print; next }
         { n = split($0, part, "`"); for (i = 2; i <= n; i += 2) print part[i] }' "$document"
}

# --- links; an anchor is the heading in lower case, blanks as hyphens ---
check_links() {
    local link file anchor
    for link in $(grep -o '](\([^)]*\))' "$document" | sed 's/^](//; s/)$//' | grep -v '^https\?:'); do
        file=${link%%#*}
        [ -z "$file" ] && file=$document || file=$(dirname "$document")/$file
        [ -e "$file" ] || { say "the link $link leads nowhere"; continue; }
        [[ $link == *#* ]] || continue
        anchor=${link#*#}
        sed -n 's/^##* //p' "$file" | tr 'A-Z ' 'a-z-' | tr -cd 'a-z0-9\n-' | grep -qx -- "$anchor" ||
            say "there is no heading $anchor in $file"
    done
}

# --- files, functions, targets ---
check_names() {
    local name path
    for name in $(code | sed 's|build/tests/||g; s|~/\.config/[a-z/]*||g' | grep -oE '\b(client|common|config|deploy|server|tests)/[A-Za-z0-9_./*-]*[A-Za-z0-9_/*]' | sort -u); do
        # shellcheck disable=SC2086
        compgen -G "$name" >/dev/null || [ -e "$(dirname "$document")/$name" ] || say "there is no $name"
    done
    for name in $(code | grep -oE '(^|[^A-Za-z0-9_./*$-])[a-z0-9_]+\.(c|h|sh|py)\b' | grep -oE '[a-z0-9_]+\.[a-z]+$' | sort -u); do
        grep -q "/$name\$" "$work/tree" || say "there is no file $name"
    done
    for name in $(code | grep -oE '[A-Za-z0-9_/]+\.[ch]:[a-z0-9_]+' | sort -u); do
        # shellcheck disable=SC2046
        grep -qE "\b${name#*:}\(" $(grep -E "(^|/)${name%:*}\$" "$work/tree") /dev/null ||
            say "there is no function ${name#*:} in ${name%:*}"
    done
    for name in $(code | grep -oE '(^|[;&|`] *|[A-Z_]+=[^ ]* )make [a-z]+' | sed 's/.*make //' | sort -u); do
        grep -qE "^$name:.*## " Makefile || say "there is no target $name"
    done
}

# --- commands: "unbake NAME --option", "unbaked NAME --option" ---
for program in unbake unbaked; do
    "$build/$program" --help | sed -nE "/^commands:/,/^\$/s/^  ($program )?([a-z-]+).*/\2/p" >"$work/$program"
done
check_commands() {
    local program name rest option
    while read -r program name rest; do
        grep -qx -- "$name" "$work/$program" || { say "there is no command $program $name"; continue; }
        for option in $(grep -oE -- '--[a-z]+[a-z-]*' <<<"$rest"); do
            "$build/$program" "$name" --help | grep -q -- "$option\b" || say "$program $name has no $option"
        done
    done < <(code | grep -oE '(^|[ /(])unbaked? [a-z][a-z-]*[^#;&|)]*' | sed -E 's|^[ /(]||' | sort -u)
}

for document in $documents; do
    check_links
    check_names
    check_commands
done

# --- README.md's tables ---
document=README.md
[ "$(wc -l <README.md)" -le 250 ] || say "more than 250 lines: a front door"
while read -r name; do
    sed -n '/^## The client/,/^## /p' README.md | grep -qE "\`$name[\` ]" || say "the client's command $name is missing"
done <"$work/unbake"
settings=$("$build/unbake" settings --json -q --retry 0 --server http://127.0.0.1:1)
while IFS='|' read -r _ names default _; do
    for name in $(grep -oE '[a-z_]+' <<<"$names"); do
        wanted=$(jq -r --arg name "$name" '.[] | select(.name == $name) | .default' <<<"$settings")
        grep -q "^$name =" config/unbaked.conf && wanted=$(sed -n "s/^$name = *//p" config/unbaked.conf)
        [ -n "$wanted" ] || grep -q "^$name =" config/unbaked.conf || say "there is no setting or option $name"
        equal "$(tr -d ' ' <<<"$default")" "$(tr -d ' ' <<<"$wanted")" "README.md: the default of $name"
    done
done < <(sed -n '/^| setting /,/^$/p; /^| option /,/^$/p' README.md | grep '^| `')
for status in $("$build/unbake" --help | sed -n '/^exit status:/,$s/^  \([0-9][0-9]*\) .*/\1/p'); do
    tr '\n' ' ' <README.md | grep -qE "Exit status:[^.]*\b$status [a-z]" || say "the exit status $status is missing"
done

# --- the manual pages have all that README.md leaves to them ---
"$build/unbake" manual unbake.1 >"$work/unbake.1"
"$build/unbaked" manual unbaked.conf.5 >"$work/unbaked.conf.5"
for name in $(jq -r '.[].name' <<<"$settings"); do
    grep -qx "\\\\fB$name\\\\fR" "$work/unbake.1" || fail "unbake.1 lacks the setting $name"
done
for name in $(sed -n 's/^\([a-z_]*\) =.*/\1/p' config/unbaked.conf); do
    grep -qx "\\\\fB$name\\\\fR" "$work/unbaked.conf.5" || fail "unbaked.conf.5 lacks the option $name"
done

# --- blocks ---
# A folder in which build/ holds the programs, with what makes rooms and jobs small, and /tmp is below it.
prepare() {
    place=$work/place
    rm -rf "$place"
    mkdir -p "$place/build" "$place/tmp" "$place/backup" "$place/etc" "$place/var/lib"
    echo "data_dir = $place/var/lib/unbaked" >"$place/etc/unbaked.conf"
    ln -s "$PWD/config" "$PWD/deploy" "$place"
    cat >"$place/build/unbaked" <<WRAPPER
#!/bin/bash
case \$1 in
demo-room) set -- "\$@" --width 64 --height 48 --frames 12 --test-frames 2 --spp 4 --test-spp 4 --texture-size 128 ;;
relight) set -- "\$@" --spp 1 ;;
--data) echo \$\$ >>"$place/pids"; set -- "\$@" --listen 127.0.0.1:$port --set min_free_mib=1 --set low_disk_mib=1 ;;
esac
exec "$build/unbaked" "\$@"
WRAPPER
    printf '#!/bin/bash\nexec "%s" "$@"\n' "$build/unbake" >"$place/build/unbake"
    chmod +x "$place/build/unbaked" "$place/build/unbake"
    cat >"$place/preamble" <<PREAMBLE
set -eu -o pipefail
export UNBAKE_SERVER=http://127.0.0.1:$port XDG_CONFIG_HOME=$place/config PATH=$place/build:\$PATH
make() { :; }
curl() { command curl --max-time 30 "\$@"; }
systemctl() {
    case \$1 in
    start) unbaked --data "$place/var/lib/unbaked" >>"$place/service.log" 2>&1 & ;;
    stop) pid=\$(tail -n 1 "$place/pids"); kill "\$pid"; while kill -0 "\$pid" 2>/dev/null; do sleep 0.05; done ;;
    esac
}
chown() { :; }
install() { mkdir -p "\${@: -1}"; }
PREAMBLE
    { printf '#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n'; printf '\x80\x80\x80\x80%.0s' $(seq 32); } >"$place/sky.hdr"
}

# The n-th block of the document, as it is to be run: builds nothing, streams end, and what a server has in / is in
# the place, belongs to whoever runs the test, and is no service of systemd's.
block() {
    cat "$place/preamble"
    awk -v n="$1" '/^```sh$/ { inside = ++count == n; next } /^```/ { inside = 0 } inside' "$document" |
        sed -E "s#(^|[ =])/(tmp|var|etc|backup)/#\\1$place/\\2/#g" | sed -e "s/127.0.0.1:7117/127.0.0.1:$port/g" -e 's/texture_size=512/texture_size=64/g' \
            -e 's/quality=draft/iterations=1/g' -e 's/"texture_size": 512, "quality": "draft"/"texture_size": 64, "iterations": 1/'
}

# What deploy/README.md takes for granted.
a_server_with_a_job() {
    cat "$place/preamble" - >"$place/block.sh" <<'BLOCK'
systemctl start unbaked
build/unbaked demo-room room
unbake submit room --set texture_size=64 --set iterations=1 --watch
BLOCK
    (cd "$place" && bash block.sh >block.log 2>&1 </dev/null) || say "the server: $(tail -n 5 "$place/block.log")"
}
# Restored, it has the job's outputs.
check_restored() {
    [ -d "$place/var/lib/unbaked.before" ] && [ ! -e "$place/var/lib/unbaked/state.db-journal" ] || say "nothing was restored"
    "$build/unbake" get last --server "http://127.0.0.1:$port" -o "$place/outputs" -q &&
        [ -s "$place/outputs/base_color.exr" ] || say "the restored server has no outputs"
}

end_all() {
    local pid
    for pid in $(cat "$place/pids" 2>/dev/null); do
        kill -TERM "$pid" 2>/dev/null && wait_for 30 not_there "$pid"
    done
}
not_there() { ! kill -0 "$1" 2>/dev/null; }

start_daemon # for a port that is free
port=${url##*:}
stop_daemon
for document in $documents; do
    count=$(grep -c '^```sh$' "$document")
    [ "$count" -gt 0 ] || continue
    prepare
    [ "$document" != deploy/README.md ] || a_server_with_a_job
    for n in $(seq "$count"); do
        block "$n" >"$place/block.sh"
        (cd "$place" && bash block.sh >block.log 2>&1 </dev/null) ||
            say "block $n fails: $(tail -n 5 "$place/block.log")"
    done
    [ "$document" != deploy/README.md ] || check_restored
    end_all
done
finish
