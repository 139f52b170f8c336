#!/bin/bash
# What deploy/ says against the tree: dependencies in three places, what is installed against what
# the packages take, shells' syntax of the completions.
set -u
build=${1:-${UNBAKE_BUILD:-build}}
case $build in *asan | *tsan) echo "nothing in it for a sanitizer"; exit 77 ;; esac
work=$(mktemp -d "${TMPDIR:-/tmp}/unbake-deploy-XXXXXX")
trap 'rm -rf "$work"' EXIT
failures=0
fail() { echo "$*"; failures=$((failures + 1)); }

# --- every library that a build needs is named wherever a build is described ---
libraries=$(sed -n '/^packages="/,/"$/p' deploy/install-deps.sh | tr ' ' '\n' | sed 's/|.*//' | grep -o '[a-z0-9.+-]*-dev\b' | grep -v '^libc6-dev$')
[ "$(wc -w <<<"$libraries")" -gt 8 ] || fail "install-deps.sh names only: $libraries"
for library in $libraries; do
    name=${library/62-turbo/} # the package has it by its virtual name
    grep -qw -- "$name" deploy/debian/control || fail "deploy/debian/control lacks $name"
    grep -qw -- "$library" deploy/Dockerfile || fail "deploy/Dockerfile lacks $library"
done

# --- what the programs load is what the container's second stage has ---
runtime=$(sed -n '/^FROM debian:12-slim$/,$p' deploy/Dockerfile)
for library in $(objdump -p "$build/unbaked" "$build/unbake" 2>/dev/null | awk '$1 == "NEEDED" && $2 !~ /^lib(c|m)\.so/ {print $2}' | sort -u); do
    file=$(ldconfig -p | awk -v name="$library" '$1 == name {print $NF; exit}')
    package=$(dpkg-query -S "$file" 2>/dev/null || dpkg-query -S "$(realpath "$file")" 2>/dev/null) || continue
    grep -qw -- "${package%%:*}" <<<"$runtime" || fail "deploy/Dockerfile's second stage lacks ${package%%:*} ($library)"
done

# --- client and server share no global name: a library of both could be made ---
names() { nm -g --defined-only "$1" 2>/dev/null | awk 'NF == 3 {print $3}' | sort -u; }
[ "$(names "$build/libclient.a" | wc -l)" -gt 50 ] || fail "libclient.a has no names"
shared=$(comm -12 <(names "$build/libclient.a") <(names "$build/libserver.a") | tr '\n' ' ')
[ -z "$shared" ] || fail "client and server both define $shared"

# --- installing ---
make -s install B="$build" PREFIX=/usr ZSH_COMPLETIONS=/usr/share/zsh/vendor-completions DESTDIR="$work/root" \
    >"$work/out" 2>&1 || fail "make install: $(tail -n 5 "$work/out")"
start=$(sed -n 's/^ExecStart=\([^ ]*\).*/\1/p' deploy/unbaked.service)
[ -x "$work/root$start" ] || fail "the unit starts $start, which is not what is installed"
"$work/root$start" check-config config/unbaked.conf >/dev/null || fail "what is installed does not run"
(cd "$work/root" && find . -type f | sed 's|^\./||') | grep -v '^usr/share/unbake/' | sort >"$work/installed"
while read -r file; do
    grep -qE "^${file%\*}(/|\$)" "$work/installed" || [[ $file = etc/* ]] || fail "a package takes $file, which is not installed"
done < <(cat deploy/debian/*.install)
while read -r file; do
    cat deploy/debian/*.install | while read -r taken; do
        [[ $file == "$taken" || $file == "$taken"/* ]] && echo "$file"
    done | grep -q . || fail "no package takes $file"
done <"$work/installed"

# --- completions ---
for file in "$work"/root/usr/share/bash-completion/completions/*; do
    bash -n "$file" || fail "bash does not read $file"
done
if command -v zsh >/dev/null; then
    for file in "$work"/root/usr/share/zsh/vendor-completions/*; do
        zsh -n "$file" || fail "zsh does not read $file"
    done
fi
exit $((failures > 0))
