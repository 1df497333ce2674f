#!/usr/bin/env bash
# Installs what the system lacks on Linux: Mesa's software Vulkan driver where there is no driver at all, and an LLVM
# new enough for Mitsuba (17 or newer; rustup's toolchains bring one) where there is none. Needs no root otherwise.
# `ensure_system.sh browser`: a Chromium with its driver, which only the tests of the live view need.
set -euo pipefail
shopt -s nullglob

[ "$(uname)" = Linux ] || exit 0 # Metal and DirectX come with their systems
home=${HOME:-/root}

have_vulkan() {
    [ -z "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ] || return 0
    local places=({/usr,/usr/local,/etc}/{share/,}vulkan/icd.d/*.json "$home"/.local/share/vulkan/icd.d/*.json)
    local loader
    loader=$({ ldconfig -p || /sbin/ldconfig -p; } 2>/dev/null | grep -c 'libvulkan\.so\.1' || true)
    [ "${#places[@]}" -gt 0 ] && [ "$loader" -gt 0 ]
}

have_llvm() {
    [ -z "${DRJIT_LIBLLVM_PATH:-}" ] || return 0
    local found=(/usr/lib/*-linux-gnu/libLLVM{.so.,-}{17,18,19,20,21,22,23}* /usr/lib64/libLLVM{.so.,-}{17,18,19,20,21,22,23}*
        "$home"/.rustup/toolchains/*/lib/libLLVM*.so*)
    [ "${#found[@]}" -gt 0 ]
}

as_root() {
    if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi
}

updated=no
install() { # one argument for each package manager: apt, dnf, pacman
    if command -v apt-get >/dev/null; then
        [ "$updated" = yes ] || as_root env DEBIAN_FRONTEND=noninteractive apt-get update -qq
        updated=yes
        # shellcheck disable=SC2086 # several packages
        as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $1
    elif command -v dnf >/dev/null; then
        # shellcheck disable=SC2086
        as_root dnf install -y -q $2
    elif command -v pacman >/dev/null; then
        # shellcheck disable=SC2086
        as_root pacman -S --noconfirm $3
    else
        return 1
    fi
}

have_browser() {
    command -v chromedriver >/dev/null &&
        { command -v chromium || command -v chromium-browser || command -v google-chrome; } >/dev/null
}

if [ "${1:-}" = browser ]; then
    have_browser || install "chromium chromium-driver" "chromium chromedriver" "chromium" ||
        echo "No Chromium could be installed: the test of the live view is skipped, which CI does not allow" >&2
    exit 0
fi
if ! have_vulkan; then
    echo "No Vulkan driver found: installing Mesa's software driver"
    install "libvulkan1 mesa-vulkan-drivers" "vulkan-loader mesa-vulkan-drivers" "vulkan-icd-loader vulkan-swrast" || {
        echo "Install the Vulkan loader and a driver (for example Mesa's lavapipe), then try again" >&2
        exit 1
    }
fi
if ! have_llvm; then
    echo "No LLVM 17 or newer found: installing one for Mitsuba"
    install libllvm19 llvm-libs llvm-libs || install libllvm18 llvm-libs llvm-libs ||
        echo "None could be installed: Mitsuba will run in its scalar variant, which is slow" >&2
fi
