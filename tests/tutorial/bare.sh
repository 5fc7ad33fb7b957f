#!/bin/bash
# bare.sh FOLDER: a bare Debian 12 in FOLDER/root (debootstrap, git, make, ca-certificates and no more), the repository's last commit beside it, and the tutorial followed
# there to the letter. The mirror is that of this system's apt sources; proxies and certificates of this system are passed through. All is taken away at the end.
# Exit status: 0 done, 2 something only the user can do, else that of the step that failed.
set -eu
here=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
fail() { echo "tutorial-bare: $*" >&2; exit 2; }
[ $# = 1 ] || fail "usage: bare.sh FOLDER"
[ "$(id -u)" = 0 ] || fail "needs root, for debootstrap and chroot: run it again as root"
command -v debootstrap >/dev/null || fail "debootstrap is not installed; run: apt-get install debootstrap"
mkdir -p "$1"
root=$(cd "$1" && pwd)/root

# First what is mounted, and nothing is deleted while anything is.
clean_up() {
    local at
    for at in dev/shm dev/pts dev proc; do
        ! mountpoint -q "$root/$at" || umount "$root/$at" || umount -l "$root/$at"
    done
    ! grep -q " $root/" /proc/mounts || fail "$root: still mounted; take it away by hand"
    rm -rf --one-file-system "$root"
}
trap clean_up EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
clean_up

mirror=$(apt-get indextargets --format '$(SITE)' 'Created-By: Packages' 'Codename: bookworm' | sort -u | head -n 1)
[ -n "$mirror" ] || fail "no apt source of Debian 12 (bookworm) here; give this system one"
began=$(date +%s)
debootstrap --variant=minbase --include=ca-certificates,git,make bookworm "$root" "$mirror" >"$root.log" 2>&1 || { tail -n 20 "$root.log" >&2; exit 1; }
echo "  $(($(date +%s) - began)) s  a bare Debian 12"

# What the network needs of this system: sources, name service, a proxy and its certificates.
cp -L /etc/resolv.conf /etc/hosts "$root/etc/"
for from in /etc/apt/sources.list /etc/apt/sources.list.d /etc/apt/apt.conf.d /etc/apt/apt.conf /etc/apt/keyrings /etc/pip.conf; do
    [ ! -e "$from" ] || { rm -rf "${root:?}$from"; mkdir -p "$root$(dirname "$from")"; cp -rL "$from" "$root$from"; }
done
cp -rL /usr/local/share/ca-certificates/. "$root/usr/local/share/ca-certificates/" 2>/dev/null || true
cp -L /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/ca-certificates.crt"
for variable in SSL_CERT_FILE REQUESTS_CA_BUNDLE PIP_CERT CURL_CA_BUNDLE; do
    file=${!variable:-}
    [ -z "$file" ] || [ ! -f "$file" ] || { mkdir -p "$root$(dirname "$file")"; cp -L "$file" "$root$file"; }
done
git clone -q --no-hardlinks "$here" "$root/repository"
chown -R root:root "$root/repository"

mount -t proc proc "$root/proc"
mount --bind /dev "$root/dev"
mount -t devpts devpts "$root/dev/pts" -o newinstance,ptmxmode=0666 2>/dev/null || true
mkdir -p "$root/dev/shm"
mountpoint -q "$root/dev/shm" || mount -t tmpfs shm "$root/dev/shm"
"$here/.venv/bin/python" "$here/tests/tutorial/run.py" "$root/tutorial" --root "$root"
