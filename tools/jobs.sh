# Sourced by tools/setup.sh: background jobs that are watched, shown, ended together and explained when
# they fail. One moving line in a terminal, plain lines elsewhere; everything on stderr.
# setup.sh sets logs and usual_seconds, and has percent_done and abandon.
# shellcheck shell=bash disable=SC2154

if [[ -t 2 && ${TERM:-dumb} != dumb ]]; then moving=yes; else moving=""; fi
if [[ ${LC_ALL:-${LC_CTYPE:-${LANG:-}}} == *[Uu][Tt][Ff]* ]]; then tick="✓"; else tick="ok"; fi
last_told=0

declare -A job_pid=() job_label=() job_started=()

# --- words --------------------------------------------------------------------------------------------

paint() { # CODE TEXT
  if [[ $moving && -z ${NO_COLOR:-} ]]; then printf '\033[%sm%s\033[0m' "$1" "$2"; else printf '%s' "$2"; fi
}

say() { # TEXT
  clear_line
  printf '%s\n' "$1" >&2
}

clear_line() { [[ ! $moving ]] || printf '\r\033[K' >&2; }

# What is going on, how long it took so far and about how long it still takes.
show_progress() {
  local percent name what="" told
  percent=$(percent_done)
  for name in "${!job_pid[@]}"; do what+="${what:+, }${job_label[$name]}"; done
  told="$percent %  $SECONDS s, about $(seconds_left "$percent") s left"
  if [[ $moving ]]; then
    what="    $told  $what"
    clear_line
    paint 2 "${what:0:$(tput cols 2>/dev/null || echo 80)-1}" >&2
  elif ((SECONDS >= last_told + 20)); then
    last_told=$SECONDS
    say "    $told"
  fi
}

# What is usual counts at first, and from half-way on only how fast it really goes. In steps of five seconds.
seconds_left() { # PERCENT
  local trust=$(($1 < 50 ? 2 * $1 : 100)) total
  total=$((($1 ? trust * SECONDS / $1 : 0) + (100 - trust) * usual_seconds / 100))
  echo $((total > SECONDS + 5 ? (total - SECONDS + 4) / 5 * 5 : 5))
}

# --- jobs ---------------------------------------------------------------------------------------------

# A process group of its own lets everything that a job started be ended with it.
start_job() { # NAME LABEL FUNCTION
  set -m
  "$3" >"$logs/$1.log" 2>&1 </dev/null &
  set +m
  job_pid[$1]=$!
  job_label[$1]=$2
  job_started[$1]=$SECONDS
}

# Waits for the named jobs, and tells of every other one that ends meanwhile.
await_jobs() { # NAME...
  local name waiting=yes
  while [[ $waiting ]]; do
    for name in "${!job_pid[@]}"; do
      kill -0 "${job_pid[$name]}" 2>/dev/null || finish_job "$name"
    done
    waiting=""
    for name in "$@"; do
      [[ -z ${job_pid[$name]:-} ]] || waiting=yes
    done
    if [[ $waiting ]]; then
      show_progress
      sleep 0.2
    fi
  done
}

finish_job() { # NAME
  local pid=${job_pid[$1]}
  unset "job_pid[$1]"
  if wait "$pid"; then
    say "$(printf '  %s %-46s%4d s' "$(paint 32 "$tick")" "${job_label[$1]}" $((SECONDS - job_started[$1])))"
  else
    say "$(paint 31 "Failed"): ${job_label[$1]}. The end of $logs/$1.log:"
    tail -n 15 "$logs/$1.log" | sed 's/^/    /' >&2
    abandon
    exit 1
  fi
}

end_jobs() {
  local pid
  for pid in "${job_pid[@]}"; do
    kill -TERM -- "-$pid" 2>/dev/null || true
    wait "$pid" 2>/dev/null || true
  done
  job_pid=()
}
