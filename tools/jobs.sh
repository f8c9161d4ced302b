# Sourced by tools/setup.sh: background jobs that are watched, shown, ended together and explained when
# they fail. One moving line in a terminal, plain lines elsewhere; everything on stderr.
# setup.sh sets logs and usual_seconds, and has percent_done and abandon.
# shellcheck shell=bash disable=SC2154

if [[ -t 2 && ${TERM:-dumb} != dumb ]]; then moving=yes; else moving=""; fi
if [[ ${LC_ALL:-${LC_CTYPE:-${LANG:-}}} == *[Uu][Tt][Ff]* ]]; then tick="✓"; else tick="ok"; fi
last_told=0
furthest=0 # percent

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
  percent=$((percent > furthest ? percent : furthest)) # a step that begins is no step back
  furthest=$percent
  for name in "${!job_pid[@]}"; do what+="${what:+, }${job_label[$name]}"; done
  told="$percent %  $SECONDS s, $(time_left "$percent")"
  if [[ $moving ]]; then
    what="    $told  $what"
    clear_line
    paint 2 "${what:0:$(tput cols 2>/dev/null || echo 80)-1}" >&2
  elif ((SECONDS >= last_told + 20)); then
    last_told=$SECONDS
    say "    $told"
  fi
}

# Two estimates make a range: what is usual, and what follows from the pace so far. In tens of seconds.
time_left() { # PERCENT
  local usual=$((usual_seconds - SECONDS)) pace=$usual_seconds low high
  if (($1 > 0)); then pace=$((SECONDS * (100 - $1) / $1)); fi
  if ((usual < pace / 2)); then usual=$((pace / 2)); fi
  low=$(((usual < pace ? usual : pace) / 10 * 10)) high=$((((usual > pace ? usual : pace) + 9) / 10 * 10))
  if ((low < 10)); then
    echo "at most $((high > 10 ? high : 10)) s left"
  else
    echo "about $low to $high s left"
  fi
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
