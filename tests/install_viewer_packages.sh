#!/bin/sh
# Software Vulkan for the tests that open a recording in the headless Rerun viewer.
# Without root or apt-get nothing is installed and those tests are skipped with a reason.
set -u
if ls /usr/share/vulkan/icd.d/lvp_icd.*.json /etc/vulkan/icd.d/lvp_icd.*.json 2>/dev/null | grep -q . &&
    ldconfig -p 2>/dev/null | grep -q libvulkan.so.1; then
    exit 0
fi
if [ "$(id -u)" -ne 0 ] || ! command -v apt-get >/dev/null 2>&1; then
    echo "no software Vulkan here; screenshots are skipped (Debian: apt-get install mesa-vulkan-drivers libvulkan1)"
    exit 0
fi
echo "installing software Vulkan for the viewer tests …"
{ apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq mesa-vulkan-drivers libvulkan1; } \
    >/dev/null 2>&1 || echo "could not install mesa-vulkan-drivers and libvulkan1; screenshots are skipped"
exit 0
