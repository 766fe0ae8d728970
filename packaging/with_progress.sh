#!/usr/bin/env bash
# with_progress.sh LOG WHAT COMMAND...: runs the command and appends all that it prints to LOG. Meanwhile one line moves
# on a terminal; elsewhere there is a line at once and one a minute. A failure shows the errors.
set -uo pipefail
log=$1 what=$2
shift 2
before=$(stat -c %s "$log" 2>/dev/null || echo 0)
terminal=no
[ -t 1 ] && terminal=yes

show_progress() {
  local line="" piece="" columns=$((${COLUMNS:-$(tput cols 2>/dev/null || echo 80)} - 1)) status next=$((SECONDS + 60))
  [ $terminal = yes ] || echo "$what; all of it goes to $log"
  while :; do
    IFS= read -r -t 1
    status=$?
    piece+=$REPLY
    if [ $status -eq 0 ]; then
      printf '%s\n' "$piece" >>"$log"
      [ -n "$piece" ] && line=$piece
      piece=""
    elif [ $status -le 128 ]; then  # the end
      printf '%s' "$piece" >>"$log"
      break
    fi
    if [ $terminal = yes ]; then
      printf '\r\033[K%.*s' "$columns" "$what: $line"
    elif [ $SECONDS -ge $next ]; then
      echo "$((SECONDS / 60)) min: $line"
      next=$((SECONDS + 60))
    fi
  done
  [ $terminal = yes ] && printf '\r\033[K'
  true
}

show_errors() {
  local errors='error: |FAILED: |undefined reference|No space left'
  if grep -q '^CMake Error' <<<"$1"; then
    sed -n '/^CMake Error/,$p' <<<"$1" | head -n 30
  elif grep -qE "$errors" <<<"$1"; then
    grep -E -A 3 "$errors" <<<"$1" | cut -c 1-300 | head -n 30
  else
    tail -n 30 <<<"$1"
  fi
}

"$@" 2>&1 </dev/null | show_progress
status=${PIPESTATUS[0]}
if [ "$status" -ne 0 ]; then
  show_errors "$(tail -c +$((before + 1)) "$log")" >&2
  echo "$what failed (exit code $status); all of it is in $log" >&2
fi
exit "$status"
