#!/usr/bin/env bash
# Installs Mesa's software Vulkan driver (and with it libLLVM, which Mitsuba wants) where no Vulkan driver is found.
set -euo pipefail

[ "$(uname)" = Linux ] || exit 0 # Metal and DirectX come with their systems
[ -z "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ] || exit 0

shopt -s nullglob
drivers=({/usr,/usr/local}/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json "${HOME:-/root}"/.local/share/vulkan/icd.d/*.json)
loader=$({ ldconfig -p || /sbin/ldconfig -p; } 2>/dev/null | grep -c 'libvulkan\.so\.1' || true)
[ "${#drivers[@]}" -eq 0 ] || [ "$loader" -eq 0 ] || exit 0

root=()
if [ "$(id -u)" -ne 0 ]; then
    root=(sudo)
fi
echo "No Vulkan driver found: installing Mesa's software driver"
if command -v apt-get >/dev/null; then
    export DEBIAN_FRONTEND=noninteractive
    "${root[@]}" apt-get update -qq
    "${root[@]}" apt-get install -y -qq --no-install-recommends libvulkan1 mesa-vulkan-drivers
elif command -v dnf >/dev/null; then
    "${root[@]}" dnf install -y -q vulkan-loader mesa-vulkan-drivers
elif command -v pacman >/dev/null; then
    "${root[@]}" pacman -S --noconfirm vulkan-icd-loader vulkan-swrast
else
    echo "Install the Vulkan loader and a driver (for example Mesa's lavapipe), then try again" >&2
    exit 1
fi
