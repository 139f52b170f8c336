#!/bin/bash
# Fails where a C file is not as .clang-format has it (`make format` mends that). Versions of clang-format differ in
# details: only 14, Debian 12's, is asked; without it the check is skipped.
tool=$(command -v clang-format-14 || command -v clang-format)
case $("$tool" --version 2>/dev/null) in
*"version 14."*) ;;
*)
    echo "no clang-format 14 (deploy/install-deps.sh format)"
    exit 77
    ;;
esac
git ls-files -z '*.c' '*.h' 2>/dev/null | xargs -0 -r "$tool" --dry-run --Werror
