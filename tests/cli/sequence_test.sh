#!/usr/bin/env bash
# One case of the end-to-end tests of sequences of frames.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

# makeFrames FIRST LAST: receivers that differ from frame to frame, and a scene.
makeFrames() {
  local frame
  generate set.ply --surfels 3k
  "$surfeit" index -q set.ply -o set.sft --memory 64M
  for ((frame = $1; frame <= $2; ++frame)); do
    generate "street.$(printf %04d "$frame").ply" --surfels 40 --seed "$frame"
  done
}

# One call for all frames writes the bytes of a call for each.
framesEqualCallsOfTheirOwn() {
  local frame n
  makeFrames 1 24
  mkdir all each
  run 0 index street.####.ply -o all/scene.####.sft --frames 1-24 --memory 64M
  says "frame 1 (1 of 24)" "frame 24 (24 of 24)" "24 frames: 24 done, 0 up to date, 0 failed"
  run 0 gather set.sft street.%04d.ply -o all/lit.%04d.ply --frames 1-24 --memory 64M \
    --mode bleeding --stats all/stats.%04d.json --progress percent
  # shellcheck disable=SC2016
  run 0 convert 'all/lit.$F4.ply' -o 'all/lit.$F.csv' --frames 1-24
  run 0 view all/lit.####.ply -o all/lit.####.png --frames 1-24 --size 24x24 --quiet
  [[ -z $said ]] || fail "said in spite of --quiet: $said"
  for ((frame = 1; frame <= 24; ++frame)); do
    n=$(printf %04d "$frame")
    "$surfeit" index -q "street.$n.ply" -o "each/scene.$n.sft" --memory 64M
    "$surfeit" gather -q set.sft "street.$n.ply" -o "each/lit.$n.ply" --memory 64M --mode bleeding
    "$surfeit" convert -q "each/lit.$n.ply" -o "each/lit.$frame.csv"
    "$surfeit" view -q "each/lit.$n.ply" -o "each/lit.$n.png" --size 24x24
    for name in "scene.$n.sft" "lit.$n.ply" "lit.$frame.csv" "lit.$n.png"; do
      sameBytes "all/$name" "each/$name"
    done
    jsonIs "all/stats.$n.json" frame "$frame" receivers 40
  done
  differentBytes all/lit.0001.ply all/lit.0002.ply
}

# Meshes, bounces, further inputs and outputs, more than one pattern in a name.
everyCommandTakesFrames() {
  local frame
  "$cornell_scene" .
  for frame in 1 2 3; do
    cp cornell.obj "cornell.$frame.obj"
    cp cornell.mtl . 2> /dev/null || true
  done
  mkdir shot.1 shot.3
  run 0 sample cornell.#.obj -o shot.#/box.##.ply --count 300 --light-samples 1 --frames 1-3x2
  run 0 index shot.#/box.##.ply -o box.##.sft --memory 64M --frames 3,1
  [[ $said == *"frame 3 (1 of 2)"*"frame 1 (2 of 2)"* ]] || fail "another order: $said"
  run 0 bounce box.##.sft -o bounced.##.sft --memory 64M --frames 1,3
  run 0 view box.##.sft --passes passes.##.exr --size 16x16 --frames 1,3
  run 0 gather bounced.##.sft passes.##.exr -o light.##.exr --cache-series light.%d.csv --memory 64M \
    --frames 1,3
  exists light.03.exr
  exists light.3.csv
  run 0 gather box.01.sft shot.1/box.01.ply -o dry.##.ply --dry-run --frames 1-2
  leavesNothing dry
}

missingFramesAreNamedAndTheOthersGoOn() {
  makeFrames 1 6
  rm street.0003.ply
  printf 'no cloud' > street.0005.ply
  run 1 gather set.sft street.####.ply -o lit.####.ply --frames 1-6 --memory 64M
  says "surfeit: frame 3: street.0003.ply" "surfeit: frame 5: street.0005.ply" \
    "6 frames: 4 done, 0 up to date, 2 failed" "2 of 6 frames failed; again with --frames 3,5"
  exists lit.0006.ply
  [[ ! -e lit.0003.ply && ! -e lit.0005.ply ]] || fail "a failed frame has a result"
  # The frames that failed again, as the message says
  generate street.0003.ply --surfels 40
  generate street.0005.ply --surfels 40
  run 0 gather set.sft street.####.ply -o lit.####.ply --frames 3,5 --memory 64M
  # A memory budget that is too small for all
  run 1 gather set.sft street.####.ply -o none.####.ply --frames 1-2 --memory 1M
  says "frame 1: " "frame 2: " "2 of 2 frames failed"
  # A sequence of one frame has the status of the frame
  run 33 gather set.sft street.####.ply -o none.####.ply --frames 2 --memory 1M
  run 74 gather set.sft none.####.ply -o none.####.png.ply --frames 2 --memory 64M
  # --strict refuses the frame whose cloud lacks something
  printf '0 0 0\n' > odd.2.xyz
  cp street.0001.ply odd.1.ply
  run 1 index odd.#.xyz -o odd.#.sft --frames 1-2 --strict --memory 64M
  says "frame 1: odd.1.xyz" "frame 2: " "refused by --strict"
}

newerFramesAreSkipped() {
  makeFrames 1 5
  local gather=(gather set.sft street.####.ply -o lit.####.ply --stats lit.####.json --memory 64M --frames 1-5 --newer)
  run 0 "${gather[@]}"
  says "5 frames: 5 done, 0 up to date, 0 failed"
  run 0 "${gather[@]}"
  says "5 frames: 0 done, 5 up to date, 0 failed"
  # An input that is newer, an output that is gone, an input that is gone
  sleep 0.05
  touch street.0002.ply
  rm lit.0004.json street.0005.ply
  run 1 "${gather[@]}"
  says "frame 2 (2 of 5)" "frame 4 (4 of 5)" "frame 5: street.0005.ply" \
    "5 frames: 2 done, 2 up to date, 1 failed"
  # A scene that all frames share
  touch set.sft
  run 1 "${gather[@]}"
  says "5 frames: 4 done, 0 up to date, 1 failed"
  # Of the same time is not newer
  touch -d "2001-01-01" set.sft street.0001.ply lit.0001.ply lit.0001.json
  run 0 gather set.sft street.####.ply -o lit.####.ply --memory 64M --frames 1 --newer
  says "1 frame: 1 done"
}

# Files behind options, and behind a name in them, are of the frame, too.
inputsOfOptionsAreOfTheFrame() {
  local frame
  makeFrames 1 2
  "$cornell_scene" .
  for frame in 1 2; do
    cp cornell.obj "mesh.$frame.obj"
    cp "street.000$frame.ply" "lamp.$frame.ply"
  done
  local index=(index street.000#.ply lamp.#.ply -o named.#.sft --group "lamp=lamp.#.ply" --memory 64M
    --frames 1-2 --newer)
  run 0 "${index[@]}"
  run 0 info named.2.sft
  says "lamp"
  run 0 "${index[@]}"
  says "2 frames: 0 done, 2 up to date, 0 failed"
  run 0 sample mesh.#.obj -o box.#.ply --count 300 --frames 1-2
  run 0 index box.#.ply -o box.#.sft --memory 64M --frames 1-2
  local relight=(relight box.#.sft -o lit.#.sft --mesh mesh.#.obj --light-directional "-1 -2 -1  3 3 3"
    --frames 1-2 --newer)
  run 0 "${relight[@]}"
  run 0 "${relight[@]}"
  says "2 frames: 0 done, 2 up to date, 0 failed"
  sleep 0.05
  touch mesh.2.obj
  run 0 "${relight[@]}"
  says "frame 2 (2 of 2)" "2 frames: 1 done, 1 up to date, 0 failed"
  # The cube of another scene, or numbers
  local cubes=(index street.000#.ply -o cube.#.sft --memory 64M --frames 1-2 --newer --cube)
  run 0 "${cubes[@]}" named.#.sft
  run 0 "${cubes[@]}" named.#.sft
  says "2 frames: 0 done, 2 up to date, 0 failed"
  touch named.1.sft
  run 0 "${cubes[@]}" named.#.sft
  says "2 frames: 1 done, 1 up to date, 0 failed"
  run 0 "${cubes[@]}" -2000,-2000,-2000,4000
  says "2 frames: 0 done, 2 up to date, 0 failed"
  rm named.2.sft
  run 1 "${cubes[@]}" named.#.sft
  says "named.2.sft"
  # An input whose name holds that of another file
  for frame in 1 2; do
    mv "mesh.$frame.obj" "a=mesh.$frame.obj"
  done
  run 0 sample a=mesh.#.obj -o again.#.ply --count 300 --frames 1-2 --newer
  mv a=mesh.2.obj mesh.2.obj
  touch -d "2001-01-01" mesh.2.obj
  run 1 sample a=mesh.#.obj -o again.#.ply --count 300 --frames 1-2 --newer
  says "a=mesh.2.obj" "2 frames: 0 done, 1 up to date, 1 failed"
}

# The peak of a frame does not count against the budget of the next.
theLeastBudgetDoesForAllFrames() {
  local least
  generate set.ply --surfels 30k
  "$surfeit" index -q set.ply -o set.sft --memory 64M
  generate r.1.ply --surfels 300
  cp r.1.ply r.2.ply
  cp r.1.ply r.3.ply
  run 33 gather set.sft r.1.ply -o lit.1.ply --memory 1M --threads 1
  least=$(sed -n -E 's/.*: ([0-9.]+) MiB is the least that works.*/\1M/p' <<< "$said")
  [[ -n $least ]] || fail "no least budget in: $said"
  run 0 gather set.sft r.1.ply -o one.ply --memory "$least" --threads 1
  run 0 gather set.sft r.#.ply -o lit.#.ply --memory "$least" --threads 1 --frames 1-3 --stats s.#.json
  sameBytes one.ply lit.3.ply
  if [[ -z ${SURFEIT_SANITIZED:-} ]]; then
    local peak
    peak=$(field s.3.json peak_resident_bytes)
    ((peak <= $(numfmt --from=iec "$least"))) || fail "peak $peak of three frames, budget $least"
  fi
}

# pagesRead STATS: into both caches.
pagesRead() {
  awk '/"misses"|"prefetches"/ { gsub(/[^0-9]/, "", $2); sum += $2; if (++n == 4) exit }
       END { print sum + 0 }' "$1"
}

# The scene that all frames share stays open, and its caches warm, within the budget.
scenesStayOpenWithinTheBudget() {
  local frame memory peak
  generate set.ply --surfels 300k
  "$surfeit" index -q set.ply -o set.sft --memory 128M
  for frame in 1 2 3; do generate "r.$frame.ply" --surfels 1000 --seed 7; done
  for memory in 48M 200M; do
    run 0 gather set.sft r.#.ply -o lit.#.ply --memory "$memory" --threads 1 --frames 1-3 \
      --stats s.#.json --quality draft
    run 0 gather set.sft r.1.ply -o one.ply --memory "$memory" --threads 1 --quality draft
    sameBytes one.ply lit.3.ply
    peak=$(field s.3.json peak_resident_bytes)
    if [[ -z ${SURFEIT_SANITIZED:-} ]]; then
      ((peak <= $(numfmt --from=iec "$memory"))) || fail "peak $peak of three frames in $memory"
    fi
  done
  # With room for all, the first frame alone reads
  [[ $(pagesRead s.3.json) == 0 ]] || fail "frame 3 reads $(pagesRead s.3.json) pages"
  # A scene of each frame is its own
  cp set.sft set.1.sft
  "$surfeit" index -q r.1.ply -o set.2.sft --memory 64M
  run 0 gather set.#.sft r.#.ply -o own.#.ply --memory 64M --frames 1-2
  run 0 gather set.2.sft r.2.ply -o one.ply --memory 64M
  sameBytes one.ply own.2.ply
}

patternsAndFramesMustFit() {
  makeFrames 1 2
  run 2 gather set.sft street.####.ply -o lit.####.ply
  says "street.####.ply: this is a pattern of frames" "--frames 1-240" '"street.0001.ply"'
  run 2 gather set.sft street.0001.ply -o lit.%04d.ply
  says "lit.%04d.ply: this is a pattern"
  # A directory whose name has a pattern
  mkdir 'take#2'
  run 0 gather set.sft street.0001.ply -o 'take#2/lit.ply'
  rm -r 'take#2'
  run 2 gather set.sft street.0001.ply -o 'take#3/lit.ply'
  says "take#3/lit.ply: this is a pattern"
  run 2 gather set.sft street.####.ply -o lit.ply --frames 1-2
  says "lit.ply: with --frames every frame would replace this output" "####"
  run 2 gather set.sft street.####.ply -o lit.####.ply --stats stats.json --frames 1-2
  says "stats.json: with --frames every frame"
  run 2 gather set.sft street.####.ply -o lit.####.ply --frames 2-1
  says "--frames: found \"2-1\", expected the lower number first: 1-2"
  run 2 gather set.sft street.####.ply -o lit.####.ply --frames one
  says "expected frames such as 1-240"
  run 2 gather set.sft street.####.ply -o lit.####.ply --newer
  says "--frames"
  # A usage error of the command stops at once, and so does one that a frame finds
  run 2 gather set.sft street.####.ply -o lit.####.ply --frames 1-2 --mode shiny
  run 2 gather set.sft street.####.ply -o street.####.ply --frames 1-2
  says "frame 1: street.0001.ply" "frames that are left: 1-2"
  leavesNothing lit
  # A file of that very name is a file
  cp street.0001.ply 'odd#.ply'
  run 0 convert 'odd#.ply' -o even.csv
  cp even.csv 'out#.csv'
  run 0 convert street.0001.ply -o 'out#.csv'
}

signalsStopAllFrames() {
  generate city.ply --surfels 300k
  local i process status=0
  for i in 1 2 3 4 5 6 7 8 9; do ln -s city.ply "city.$i.ply"; done
  "$surfeit" index city.#.ply -o city.#.sft --frames 1-9 --memory 64M > said.txt 2>&1 &
  process=$!
  for ((i = 0; i < 1500; ++i)); do
    if [[ -e city.1.sft ]] && resultIsOpen "$process"; then break; fi
    sleep 0.02
  done
  kill -TERM "$process" || fail "ended before the signal"
  wait "$process" || status=$?
  [[ $status == 143 ]] || fail "exit status $status after SIGTERM: $(cat said.txt)"
  grep -q "frames that are left: [2-9]-9" said.txt || fail "$(cat said.txt)"
  [[ ! -e city.9.sft ]] || fail "went on"
  [[ -z $(find . -name '*.tmp') ]] || fail "temporary files left behind"
}

runCase
