#!/bin/sh
# Software Vulkan for the tests that open a recording in the headless Rerun viewer, Chromium for those of the gateway's page.
# Without root or apt-get nothing is installed and those tests are skipped with a reason.
set -u
packages=""
if ! { ls /usr/share/vulkan/icd.d/lvp_icd.*.json /etc/vulkan/icd.d/lvp_icd.*.json 2>/dev/null | grep -q . &&
    ldconfig -p 2>/dev/null | grep -q libvulkan.so.1; }; then
    packages="mesa-vulkan-drivers libvulkan1"
fi
browser=""
for name in chromium-headless-shell chromium chromium-browser google-chrome; do
    command -v "$name" >/dev/null 2>&1 && browser="$name"
done
[ -n "$browser" ] || packages="$packages chromium-headless-shell fonts-dejavu-core"
[ -n "$packages" ] || exit 0
if [ "$(id -u)" -ne 0 ] || ! command -v apt-get >/dev/null 2>&1; then
    echo "not here, and their tests are skipped (Debian: apt-get install $packages)"
    exit 0
fi
echo "installing $packages for the tests …"
apt-get update -qq >/dev/null 2>&1
for package in $packages; do
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$package" >/dev/null 2>&1 ||
        echo "could not install $package; the tests that need it are skipped"
done
exit 0
