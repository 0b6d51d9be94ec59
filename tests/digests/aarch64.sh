#!/usr/bin/env bash
# Makes a root directory of 64-bit Arm with Python and the dependencies, for `python tests/digests/machines.py --aarch64 FOLDER`.
# Needs root on a Debian machine; takes some ten minutes and 1 GB.
#
#     tests/digests/aarch64.sh FOLDER [MIRROR]
set -euo pipefail
root="$(realpath -m "${1:?usage: tests/digests/aarch64.sh FOLDER [MIRROR]}")"
mirror="${2:-http://deb.debian.org/debian}"

apt-get install -y --no-install-recommends qemu-user-static debootstrap
if [ ! -e /proc/sys/fs/binfmt_misc/qemu-aarch64 ]; then
    mountpoint -q /proc/sys/fs/binfmt_misc || mount -t binfmt_misc binfmt_misc /proc/sys/fs/binfmt_misc
    cat /usr/lib/binfmt.d/qemu-aarch64.conf >/proc/sys/fs/binfmt_misc/register
fi
if [ ! -x "$root/usr/bin/python3" ]; then
    debootstrap --foreign --arch=arm64 --variant=minbase --include=python3,ca-certificates bookworm "$root" "$mirror"
    cp /usr/bin/qemu-aarch64-static "$root/usr/bin/"
    chroot "$root" /debootstrap/debootstrap --second-stage
fi
mountpoint -q "$root/proc" || mount --bind /proc "$root/proc"
mountpoint -q "$root/dev" || mount --bind /dev "$root/dev"

# Wheels are fetched here and unpacked there: pip would take half an hour in the emulator.
wheels="$(mktemp -d)"
trap 'rm -rf "$wheels"' EXIT
version="$(chroot "$root" python3 -c 'import sys; print("%d.%d" % sys.version_info[:2])')"
platforms=(--platform manylinux2014_aarch64)
for minor in $(seq 17 36); do platforms+=(--platform "manylinux_2_${minor}_aarch64"); done
mapfile -t packages < <(python3 -c 'import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["project"]["dependencies"], sep="\n")')
python3 -m pip download -q "${platforms[@]}" --python-version "$version" --only-binary=:all: -d "$wheels" "${packages[@]}"
rm -rf "$root/opt/site"
mkdir -p "$root/opt/site"
for wheel in "$wheels"/*.whl; do python3 -m zipfile -e "$wheel" "$root/opt/site"; done
echo "ready: python tests/digests/machines.py --aarch64 $root"
