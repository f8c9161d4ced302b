# Sourced by tools/setup.sh: calm progress on stderr, one moving line in a terminal, plain lines elsewhere.
# shellcheck shell=bash

if [[ -t 2 && ${TERM:-dumb} != dumb ]]; then moving=yes; else moving=""; fi
if [[ ${LC_ALL:-${LC_CTYPE:-${LANG:-}}} == *[Uu][Tt][Ff]* ]]; then tick="✓"; else tick="ok"; fi
last_told=0

paint() { # CODE TEXT
  if [[ $moving && -z ${NO_COLOR:-} ]]; then printf '\033[%sm%s\033[0m' "$1" "$2"; else printf '%s' "$2"; fi
}
bold() { paint 1 "$1"; }
red() { paint 31 "$1"; }
green() { paint 32 "$1"; }
dim() { paint 2 "$1"; }

say() { printf '%s\n' "$1" >&2; }

progress_clear() { [[ ! $moving ]] || printf '\r\033[K' >&2; }

progress_done() { # WHAT SECONDS
  progress_clear
  printf '  %s %-44s %4d s\n' "$(green "$tick")" "$1" "$2" >&2
}

# Tells how far things are, how long they took and about how long they still take.
progress_show() { # PERCENT WHAT
  local left="" columns line
  (($1 < 8)) || left=", about $((SECONDS * (100 - $1) / $1 + 1)) s left"
  line="    $1 %  $2  $SECONDS s$left"
  if [[ $moving ]]; then
    columns=$(tput cols 2>/dev/null || echo 80)
    printf '\r\033[K%s' "$(dim "${line:0:columns-1}")" >&2
  elif ((SECONDS >= last_told + 20)); then
    last_told=$SECONDS
    say "$line"
  fi
}
