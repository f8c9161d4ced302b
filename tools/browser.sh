#!/usr/bin/env bash
#
# Sees to it that there is a Chromium for the tests of pages. As root, where apt-get is, it is installed;
# otherwise it is only said what to install, and those tests fail with the same words.

set -euo pipefail

has_browser() {
  local name
  command -v chromedriver >/dev/null || return 1
  for name in chromium chromium-browser google-chrome google-chrome-stable; do
    if command -v "$name" >/dev/null; then return 0; fi
  done
  return 1
}

if has_browser; then exit 0; fi
if [[ $(id -u) -eq 0 ]] && command -v apt-get >/dev/null; then
  echo "Installing Chromium for the tests of pages."
  if apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium chromium-driver >/dev/null; then exit 0; fi
fi
echo "Pages are tested in Chromium, and there is none: sudo apt install chromium chromium-driver" >&2
