#!/bin/bash
# Fails where a C file is not as .clang-format has it (`make format` mends that), or a comment exceeds its 120 columns,
# which clang-format leaves. Versions of clang-format differ in details: only 14, Debian 12's, is asked; without it the
# check is skipped.
tool=$(command -v clang-format-14 || command -v clang-format)
case $("$tool" --version 2>/dev/null) in
*"version 14."*) ;;
*)
    echo "no clang-format 14 (deploy/install-deps.sh format)"
    exit 77
    ;;
esac
long=$(git ls-files -z '*.c' '*.h' 2>/dev/null | LC_ALL=C.UTF-8 xargs -0 -r grep -nE '^.{121}' /dev/null |
    grep -E '^[^:]*:[0-9]+: *(/\*|\*)')
[ -z "$long" ] || {
    printf 'comments of more than 120 columns:\n%s\n' "$long"
    exit 1
}
git ls-files -z '*.c' '*.h' 2>/dev/null | xargs -0 -r "$tool" --dry-run --Werror
