#!/bin/bash
# setup.sh demo|test|check|deep: system packages, then a virtual environment in .venv with the command `hullguard`. Each level has what those before it have.
# Says nothing and does nothing when all is there. The environment (proxies, certificates, indexes) is passed through.
# Exit status: 0 ready, 2 something only the user can do (one line on stderr says what), else that of the step that failed.
set -u
level=${1:-}
levels="demo test check deep"
# Of these levels, up to the one named; and from the one named on.
up_to() { local l; for l in $levels; do echo "$l"; [ "$l" != "$1" ] || break; done; }
from() { echo "$levels" | grep -o "\b$1\b.*"; }
case " $levels " in *" $level "*) ;; *) echo "usage: setup.sh ${levels// /|}" >&2; exit 2;; esac
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd) || exit 2
venv=$root/.venv
tools=$root/host_tools
list=$root/tests/packages.txt
uv=uv==0.13.9   # not among the requirements: they must be installable where there is no uv

say() { echo "setup: $*"; }
fail() { echo "setup: $*" >&2; exit 2; }

# The package names of every section up to the level's own.
packages() {
    local line wanted=
    while read -r line; do
        case $line in
            ''|'#'*) ;;
            '['*']') wanted=$(up_to "$level" | grep -x "${line//[][]/}");;
            *) [ -z "$wanted" ] || echo "$line";;
        esac
    done <"$list"
}

install_packages() {
    local missing=$1 output as_root=()
    local update="apt-get -q update"
    local install="apt-get -q install -y --no-install-recommends -o DPkg::Lock::Timeout=300 -o Acquire::Retries=3 $missing"
    if [ "$(id -u)" != 0 ]; then
        command -v sudo >/dev/null || fail "run this as root, then again what you ran: apt-get update && $install"
        as_root=(sudo --preserve-env="http_proxy,https_proxy,no_proxy,HTTP_PROXY,HTTPS_PROXY,NO_PROXY")
    fi
    say "installing system packages: $missing"
    # Unquoted on purpose: the lines are lists of words. Indexes of a third party that fail need not matter, so update may fail.
    "${as_root[@]}" $update >/dev/null || say "apt-get update had errors; going on with the package lists there are"
    output=$("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive $install 2>&1 </dev/null) \
        || { tail -n 20 <<<"$output" >&2; fail "apt-get failed; run this as root, then again what you ran: apt-get update && $install"; }
}

# Where there is no apt, the tools may have come some other way: name what lacks, stop only where nothing would work.
look_for_tools() {
    local tool absent=() wanted=(gcc linux.uml ip)
    [ "$level" = demo ] || wanted+=(g++ clang-19 llvm-profdata-19 valgrind candump qemu-system-riscv32 qemu-system-aarch64 riscv64-unknown-elf-gcc arm-none-eabi-gcc)
    case $level in check|deep) wanted+=(frama-c why3 z3 gappa);; esac
    [ "$level" != deep ] || wanted+=(afl-fuzz afl-clang-fast)
    for tool in "${wanted[@]}"; do
        PATH=$PATH:/usr/sbin:/sbin command -v "$tool" >/dev/null || absent+=("$tool")
    done
    [ ${#absent[@]} = 0 ] || say "no apt here and not found: ${absent[*]}; tests/packages.txt has Debian's names for what is needed" >&2
    command -v gcc >/dev/null || fail "a C compiler named gcc is needed"
}

system_packages() {
    if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then look_for_tools; return; fi
    local wanted have name missing=()
    mapfile -t wanted < <(packages)
    # The status field, not the exit status: a removed package whose configuration stays is known to dpkg as well.
    # Version-free architecture suffixes do not appear in ${Package}, so foreign architectures do no harm.
    have=$'\n'$(dpkg-query -W -f '${Package} ${db:Status-Status}\n' "${wanted[@]}" 2>/dev/null)$'\n'
    for name in "${wanted[@]}"; do
        case $have in *$'\n'"$name installed"$'\n'*) ;; *) missing+=("$name");; esac
    done
    [ ${#missing[@]} = 0 ] || install_packages "${missing[*]}"
}

# The first python3 on PATH that is new enough; its real file, because a shim in front of it is slow inside with-vcan.
find_python() {
    local candidate
    while read -r candidate; do
        "$candidate" -IS -c 'import os, sys; sys.version_info >= (3, 11) or sys.exit(1); print(os.path.realpath(sys.executable))' \
            2>/dev/null && return
    done < <(type -ap python3)
    fail "Python 3.11 or newer is needed: no python3 on PATH is (found: $(python3 --version 2>&1 | head -n 1))"
}

# The file of Python packages of a level; `deep` needs none beyond those of `check`.
requirements() { echo "$tools/requirements-${1/deep/check}.txt"; }

# What .venv was made from. Its own path is part of it, because the scripts in a virtual environment hold that path.
fingerprint() {
    local l
    echo "$venv $1"
    for l in $(up_to "$1"); do requirements "$l"; done | xargs sha256sum "$tools/setup.sh" "$tools/pyproject.toml" | cut -d' ' -f1
}

# Finding is enough: importing would cost the start-up time of everything the package uses.
imports='import importlib.util, sys; sys.exit(importlib.util.find_spec("hullguard") is None)'

# Ready if the stamp of this level, or of a higher one, is that of the present files, and the interpreter still starts.
ready() {
    [ -x "$venv/bin/hullguard" ] && "$venv/bin/python" -I -c "$imports" 2>/dev/null || return 1
    local l
    for l in $(from "$level"); do
        [ "$(cat "$venv/stamp-$l" 2>/dev/null)" != "$(fingerprint "$l")" ] || return 0
    done
    return 1
}

make_venv() {
    local python output
    # It is made empty first: through a link that would be somebody else's.
    [ ! -L "$venv" ] || fail ".venv is a link to $(readlink -f "$venv"), which was not made for this folder; remove the link and run this again"
    python=$(find_python) || exit 2
    say "making .venv with $("$python" --version)"
    output=$("$python" -m venv --clear "$venv" 2>&1) \
        || { echo "$output" >&2; fail "python3 -m venv failed (Debian's package is python3-venv)"; }
}

pip_install() { "$venv/bin/python" -m pip install -q --disable-pip-version-check --no-input "$@"; }

# uv is several times quicker than pip, but it is only a quicker way: where it is not to be had, pip does the same.
install_python_packages() {
    local requirements
    requirements=$(requirements "$level")
    export UV_SYSTEM_CERTS=${UV_SYSTEM_CERTS:-1}
    say "installing Python packages ($level)"
    "$venv/bin/uv" --version 2>/dev/null | grep -qF "${uv/==/ }" || pip_install "$uv" 2>/dev/null || say "no uv here; using pip"
    if [ ! -x "$venv/bin/uv" ] || ! VIRTUAL_ENV=$venv "$venv/bin/uv" pip install -q --compile-bytecode -r "$requirements"; then
        pip_install -r "$requirements" || return
    fi
    # --no-build-isolation: the build backend is pinned and already there.
    pip_install --no-deps --no-build-isolation -e "$tools"
}

python_environment() {
    # make may run two levels at once; a folder can be locked without leaving a file behind.
    exec 9<"$root"
    flock 9
    ready && return
    if [ ! -f "$venv/origin" ] || [ "$(cat "$venv/origin")" != "$venv" ] \
        || ! "$venv/bin/python" -c 'import pip, sys; sys.version_info >= (3, 11) or sys.exit(1)' 2>/dev/null; then
        make_venv
        echo "$venv" >"$venv/origin"
    fi
    rm -f "$venv/stamp-$level"
    install_python_packages || { say "installing Python packages failed" >&2; exit 1; }
    "$venv/bin/python" -I -c "$imports" || { say "host_tools/hullguard is not there or cannot be found by Python" >&2; exit 1; }
    fingerprint "$level" >"$venv/stamp-$level"   # last: without it the next run repairs
}

system_packages
python_environment
