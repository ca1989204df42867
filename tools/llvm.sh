#!/bin/sh
# Sees to the LLVM library that Mitsuba compiles its kernels with: version 16 or newer.
set -eu
find_newest() {
    ldconfig -p 2>/dev/null | sed -n 's/.*libLLVM[-.]\(so\.\)\{0,1\}\([0-9][0-9]*\).*/\2/p' |
        sort -n | tail -n 1
}
[ -n "${DRJIT_LIBLLVM_PATH:-}" ] && exit 0
PATH=$PATH:/sbin:/usr/sbin
newest=$(find_newest)
[ "${newest:-0}" -ge 16 ] && exit 0
if [ "$(uname)" = Linux ] && command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
    apt-get update -qq
    package=$(apt-cache search --names-only '^libllvm[0-9]+$' | sed -n 's/^libllvm\([0-9]*\) .*/\1/p' |
        sort -n | tail -n 1)
    if [ "${package:-0}" -ge 16 ]; then
        apt-get install -y -qq "libllvm$package"
        exit 0
    fi
fi
if [ "$(uname)" = Darwin ]; then
    command="brew install llvm"
else
    command="sudo apt-get install libllvm19"
fi
echo "Rendering needs the LLVM library, version 16 or newer (found: ${newest:-none}). Install it with:" >&2
echo "    $command" >&2
exit 1
