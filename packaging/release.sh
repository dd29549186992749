#!/usr/bin/env bash
# Release archives and Debian packages for Linux on x86-64 and arm64, for glibc 2.28 and newer (Debian 10, Ubuntu 18.10, RHEL 8).
#
#   packaging/release.sh [FOLDER]          everything, into FOLDER (dist/)
#   TARGETS=x86_64-unknown-linux-gnu packaging/release.sh
#
# Asks for: cargo-zigbuild and zig (pip install cargo-zigbuild ziglang), the targets of the toolchain (rustup target add ...), python3, and dpkg-deb for
# the packages. The same sources make the same files: names are sorted, times are those of the last commit.
set -euo pipefail
cd "$(dirname "$0")/.."

dist=${1:-dist}
glibc=2.28
read -ra targets <<<"${TARGETS:-x86_64-unknown-linux-gnu aarch64-unknown-linux-gnu}"
version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"/\1/p' Cargo.toml)
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)}
export SOURCE_DATE_EPOCH
built=${CARGO_TARGET_DIR:-target}
mkdir -p "$dist"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

step() { printf '== %s\n' "$*" >&2; "$@"; }

# Pages, completions: the program's own words, from a program that runs on this machine.
step cargo build --release -p groundcal-cli
program=$built/release/groundcal
"$program" man --out "$work/man1" --quiet
rm -f "$work"/man1/.groundcal-manifest.json
mkdir -p "$work/completions"
"$program" completions bash >"$work/completions/groundcal.bash"
"$program" completions zsh >"$work/completions/_groundcal"
"$program" completions fish >"$work/completions/groundcal.fish"

# Files of a given mode, in a fixed order, at a fixed time.
put() { install -D -m "$1" "$2" "$3"; }

archive() {
    local target=$1 binary=$2 name=groundcal-$version-$1 root
    root=$work/$name
    put 755 "$binary" "$root/groundcal"
    for file in README.md CHANGELOG.md LICENSE-MIT LICENSE-APACHE; do put 644 "$file" "$root/$file"; done
    put 644 docs/install.md "$root/INSTALL.md"
    put 644 "$work/licences-$target.txt" "$root/THIRD-PARTY-LICENCES.txt"
    for page in "$work"/man1/*.1; do put 644 "$page" "$root/man/man1/$(basename "$page")"; done
    for file in "$work"/completions/*; do put 644 "$file" "$root/completions/$(basename "$file")"; done
    tar -C "$work" --sort=name --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 --numeric-owner -cJf "$dist/$name.tar.xz" "$name"
    echo "$dist/$name.tar.xz"
}

package() {
    local target=$1 binary=$2 arch root
    case $target in
        x86_64-*) arch=amd64 ;;
        aarch64-*) arch=arm64 ;;
        *) echo "no Debian architecture for $target" >&2; return ;;
    esac
    command -v dpkg-deb >/dev/null || { echo "skipped: no dpkg-deb, so no package for $arch" >&2; return; }
    root=$work/deb-$arch
    put 755 "$binary" "$root/usr/bin/groundcal"
    for page in "$work"/man1/*.1; do
        mkdir -p "$root/usr/share/man/man1"
        gzip -9n <"$page" >"$root/usr/share/man/man1/$(basename "$page").gz"
    done
    put 644 "$work/completions/groundcal.bash" "$root/usr/share/bash-completion/completions/groundcal"
    put 644 "$work/completions/_groundcal" "$root/usr/share/zsh/vendor-completions/_groundcal"
    put 644 "$work/completions/groundcal.fish" "$root/usr/share/fish/vendor_completions.d/groundcal.fish"
    local doc=$root/usr/share/doc/groundcal
    mkdir -p "$doc"
    { cat packaging/copyright; echo; cat LICENSE-MIT; } >"$doc/copyright"
    gzip -9n <CHANGELOG.md >"$doc/changelog.gz"
    gzip -9n <"$work/licences-$target.txt" >"$doc/THIRD-PARTY-LICENCES.txt.gz"
    find "$root" -type d -exec chmod 755 {} +
    find "$root" -type f -not -path '*/usr/bin/*' -exec chmod 644 {} +
    mkdir "$root/DEBIAN"
    cat >"$root/DEBIAN/control" <<END
Package: groundcal
Version: $version
Architecture: $arch
Maintainer: The groundcal authors <groundcal@users.noreply.github.com>
Installed-Size: $(du -sk --exclude=DEBIAN "$root" | cut -f1)
Depends: libc6 (>= $glibc)
Section: graphics
Priority: optional
Homepage: $(sed -n '/^\[workspace.package\]/,/^\[/s/^repository = "\(.*\)"/\1/p' Cargo.toml)
Description: calibrate a camera from the floor it looks at
 Camera matrix, lens and attitude with error bars from photographs taken while the camera
 turns about the normal of a plane: no checkerboard, no target.
END
    find "$root" -exec touch -h -d "@$SOURCE_DATE_EPOCH" {} +
    dpkg-deb --root-owner-group -Zxz --build "$root" "$dist/groundcal_${version}_$arch.deb" >&2
    echo "$dist/groundcal_${version}_$arch.deb"
}

files=()
for target in "${targets[@]}"; do
    step cargo zigbuild --profile dist -p groundcal-cli --target "$target.$glibc"
    binary=$built/$target/dist/groundcal
    step python3 packaging/licences.py "$target" "$work/licences-$target.txt"
    # What it asks for of the system's libraries is what was promised.
    newest=$(python3 packaging/newest_glibc.py "$binary")
    [ "$(printf '%s\n%s\n' "$newest" "$glibc" | sort -V | tail -1)" = "$glibc" ] ||
        { echo "$binary asks for glibc $newest" >&2; exit 1; }
    echo "$target: $(stat -c %s "$binary") bytes, asks for glibc $newest" >&2
    files+=("$(archive "$target" "$binary")")
    deb=$(package "$target" "$binary")
    [ -z "$deb" ] || files+=("$deb")
done
(cd "$dist" && sha256sum "${files[@]##*/}" >SHA256SUMS)
printf '%s\n' "${files[@]}" "$dist/SHA256SUMS"
