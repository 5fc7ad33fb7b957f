#!/bin/sh
# cbmc.sh DEST: the model checker CBMC, of a newer Debian than this project's, below DEST and run by its own loader: nothing is installed, no root
# is needed. About 26 MB from the mirror that apt is set up for, checked by apt's signatures. Does nothing when it is there.
set -eu
dest=$1
release=trixie
packages="cbmc libc6 libstdc++6 libgcc-s1 minisat zlib1g"
programs="cbmc goto-cc goto-instrument"
keys=/usr/share/keyrings/debian-archive-keyring.gpg

[ ! -x "$dest/bin/cbmc" ] || [ ! -x "$dest/bin/goto-instrument" ] || exit 0
fail() { echo "cbmc.sh: $*" >&2; exit 2; }

[ "$(uname -m)" = x86_64 ] || fail "CBMC is fetched for x86_64 only; put bin/cbmc, bin/goto-cc and bin/goto-instrument (6.6) below $dest"
for tool in apt-get dpkg-deb tar; do
    command -v "$tool" >/dev/null || fail "no $tool here: put bin/cbmc, bin/goto-cc and bin/goto-instrument (CBMC 6.6) below $dest"
done
[ -r "$keys" ] || fail "no keys of Debian's archive in $keys: install debian-archive-keyring"
mirror=$(apt-get indextargets --format '$(SITE)' 'Created-By: Packages' 'Codename: bookworm' 2>/dev/null | head -n 1)
[ -n "$mirror" ] || fail "apt knows no mirror of Debian: run apt-get update, then this again"

# An apt of its own, which knows that release alone: the system's lists and status are neither read nor written.
work=$(mktemp -d)
trap 'rm -rf "$work" "$dest.part"' EXIT
mkdir -p "$work/lists/partial" "$work/archives/partial"
chmod 755 "$work"
: >"$work/status"
echo "deb [arch=amd64 signed-by=$keys] $mirror $release main" >"$work/sources.list"
cat >"$work/conf" <<C
Dir::State "$work"; Dir::State::status "$work/status"; Dir::Cache "$work"; Dir::Etc::sourcelist "$work/sources.list"; Dir::Etc::sourceparts "$work/parts";
Dir::Etc::parts "$work/conf.d"; Dir::Cache::pkgcache ""; Dir::Cache::srcpkgcache ""; Acquire::Languages "none"; Acquire::Retries "3"; APT::Sandbox::User "$(id -un)";
C
mkdir "$work/parts" "$work/conf.d"
# Proxies and the like as the system has them; but not its hooks: in containers one of them empties the system's cache, under the hands of an apt that is installing from it.
eval "$(apt-config shell system Dir::Etc::parts/d)"
cp "$system"/* "$work/conf.d/" 2>/dev/null || true
for hook in APT::Update::Pre-Invoke APT::Update::Post-Invoke APT::Update::Post-Invoke-Success; do echo "#clear $hook;"; done >"$work/conf.d/zzz-no-hooks"
export APT_CONFIG="$work/conf"
apt-get -qq -o APT::Update::Error-Mode=any update >"$work/log" 2>&1 || { cat "$work/log" >&2; fail "the list of packages of Debian $release could not be read: is there a network?"; }
# $packages: a list of words
(cd "$work/archives" && apt-get -qq download $packages) >"$work/log" 2>&1 || { cat "$work/log" >&2; fail "the packages could not be fetched: $packages"; }

rm -rf "$dest.part"
mkdir -p "$dest.part/bin"
for package in "$work"/archives/*.deb; do
    dpkg-deb --fsys-tarfile "$package" | tar -x -C "$dest.part" ||  fail "$(basename "$package") cannot be unpacked"
done
for program in $programs; do
    [ -e "$dest.part/usr/bin/$program" ] || fail "the package has no $program"
    cat >"$dest.part/bin/$program" <<'P'
#!/bin/sh
usr=$(dirname "$(dirname "$(readlink -f "$0")")")/usr
exec "$usr/lib/x86_64-linux-gnu/ld-linux-x86-64.so.2" --argv0 "$0" --library-path "$usr/lib/x86_64-linux-gnu:$usr/lib" "$usr/bin/$(basename "$0")" "$@"
P
    chmod +x "$dest.part/bin/$program"
done
"$dest.part/bin/cbmc" --version >/dev/null || fail "what was unpacked does not run"
rm -rf "$dest"
mv "$dest.part" "$dest"
