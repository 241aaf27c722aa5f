#!/usr/bin/env bash
# One case of the end-to-end tests of outputs and pipes.
source "$(dirname "${BASH_SOURCE[0]}")/cli_steps.sh"

inputsAreNoOutputs() {
  generate city.ply --surfels 3k
  ln -s city.ply link.ply
  ln city.ply hard.ply
  cp city.ply before.ply
  local output
  for output in city.ply link.ply hard.ply ./city.ply; do
    run 2 index city.ply -o "$output"
    says "--output would replace its input city.ply" "give another name"
  done
  run 2 index city.ply -o city.sft --stats city.ply
  says "--stats would replace its input"
  run 2 index city.ply -o city.sft --stats city.sft
  says "would write the same file"
  run 0 index city.ply -o city.sft
  run 2 gather city.sft city.ply -o city.ply
  run 2 gather city.sft city.ply -o city.sft
  run 2 convert before.ply -o out.ply --stats before.ply
  run 2 tune city.sft city.ply --plot city.sft
  run 2 gather city.sft city.ply -o out.ply --stats out.ply
  run 2 gather city.sft city.ply -o out.ply --stats ./out.ply
  says "would write the same file"
  run 2 gather city.sft city.ply -o out.ply --cache-series city.sft
  says "--cache-series would replace its input"
  run 2 gather city.sft city.ply -o out.ply --cache-series "$PWD/out.ply"
  run 2 gather city.sft city.ply -o out.ply --stats s.json --cache-series s.json
  [[ ! -e out.ply ]] || fail "worked before it looked at its outputs"
  sameBytes city.ply before.ply
  run 0 verify city.sft
  run 0 convert city.ply -o city.ply # works in place
  sameBytes city.ply before.ply
}

# refusesToReplace FILE OPTION ARGUMENT...: the command names FILE, and no option may write there.
refusesToReplace() {
  local file=$1 option=$2
  shift 2
  cp "$file" kept
  run 2 "$@"
  says "$file: $option would replace" "give another name"
  sameBytes "$file" kept
}

# Files that stand within the value of an option, or in another option than those given by position.
# What they hold does not matter: nothing is read before the names are compared.
inputsWithinOptionsAreNoOutputs() {
  local name
  for name in cloud.csv tr.csv cams.csv env.exr like.las map.vdb old.sft group.ply place.sft hidden.csv; do
    echo "$name" > "$name"
  done
  ln -s tr.csv link.csv
  ln tr.csv hard.csv
  for name in tr.csv link.csv hard.csv; do
    refusesToReplace "$name" --output normals cloud.csv -o "$name" --orient "trajectory tr.csv"
  done
  refusesToReplace tr.csv --stats normals cloud.csv -o out.csv --orient "trajectory ./tr.csv" --stats tr.csv
  refusesToReplace group.ply --output index cloud.csv --group lamp=group.ply -o group.ply
  refusesToReplace group.ply --stats index cloud.csv --group "a=b=group.ply" --group lamp=group.ply \
    -o out.sft --stats group.ply
  refusesToReplace place.sft --output index cloud.csv --cube place.sft -o place.sft
  refusesToReplace cams.csv --output sample mesh.ply --camera-file cams.csv -o cams.csv
  refusesToReplace cams.csv --stats sample mesh.ply --camera-file cams.csv -o out.ply --stats cams.csv
  refusesToReplace env.exr --stats gather old.sft cloud.csv --environment env.exr -o out.csv --stats env.exr
  refusesToReplace env.exr --cache-series gather old.sft cloud.csv --environment env.exr -o out.csv \
    --cache-series env.exr
  refusesToReplace env.exr --plot tune old.sft cloud.csv --environment env.exr --plot env.exr
  refusesToReplace env.exr --output ptfilter --envmap env.exr cloud.csv env.exr
  refusesToReplace cloud.csv --output ptfilter --filter occlusion cloud.csv cloud.csv
  refusesToReplace map.vdb --output brickmake map.vdb map.vdb
  refusesToReplace like.las --output convert cloud.csv --like like.las -o like.las
  refusesToReplace map.vdb --stats view cloud.csv --brick map.vdb -o out.png --stats map.vdb
  refusesToReplace cloud.csv --stats cube old.sft --receivers cloud.csv -o out.png --stats cloud.csv
  refusesToReplace cloud.csv --output merge old.sft cloud.csv --shards 2 -o cloud.csv
  refusesToReplace map.vdb --output lookup map.vdb cloud.csv -o map.vdb
  refusesToReplace cloud.csv --stats bounce cloud.csv -o out.sft --stats cloud.csv
  refusesToReplace cloud.csv --output radiance cloud.csv -o cloud.csv
  refusesToReplace env.exr --output composite env.exr -o env.exr
  [[ ! -e out.csv && ! -e out.sft && ! -e out.png ]] || fail "worked before it looked at its outputs"
}

# Material files and their pictures, with names as OBJ files may have them.
filesThatMeshesNameAreNoOutputs() {
  mkdir sub
  printf 'newmtl a\nKd 1 1 1\nMAP_KD -s 1 1 1 kd.png\nmap_Ke ke.png\nmap_d sub\\mask.png\n' > a.mtl
  printf 'newmtl b\nmap_Kd deep.png\n' > "sub/two words.mtl"
  echo "newmtl c" > c.mtl
  local name
  for name in kd.png ke.png sub/mask.png sub/deep.png other.png; do echo "$name" > "$name"; done
  printf 'mtllib a.mtl c.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n  mtllib sub/two words.mtl\nf 1 2 3\n' > a.obj
  cp a.obj upper.OBJ
  ln a.mtl hard.ply
  echo scene > old.sft
  for name in a.mtl c.mtl "sub/two words.mtl" kd.png ke.png sub/mask.png sub/deep.png; do
    refusesToReplace "$name" --stats sample a.obj -o out.ply --stats "$name"
    says "named in a.obj"
    refusesToReplace "$name" --stats relight old.sft --mesh a.obj --light-point "0 0 0 1 1 1" -o out.sft \
      --stats "$name"
    refusesToReplace "$name" --stats cube old.sft --at 0,0,0 --reference a.obj -o out.png --stats "$name"
  done
  refusesToReplace hard.ply --output sample upper.OBJ -o hard.ply
  refusesToReplace kd.png --output cube old.sft --at 0,0,0 --reference a.obj -o kd.png
  refusesToReplace hard.ply --caustic-photons sample a.obj --photons 9 -o out.ply --caustic-photons hard.ply
  [[ ! -e out.ply && ! -e out.sft && ! -e out.png ]] || fail "worked before it looked at its outputs"
  printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n' > plain.obj
  run 0 sample plain.obj -o out.ply --count 10 --stats other.png # names nothing
}

linksAndPermissionsStay() {
  generate city.ply --surfels 3k
  mkdir sub
  ln -s sub/target.csv link.csv
  run 0 convert city.ply -o link.csv # the target is not there yet
  [[ -L link.csv && -f sub/target.csv ]] || fail "the link is gone"
  cp sub/target.csv first.csv
  echo old > sub/target.csv
  chmod 640 sub/target.csv
  run 0 convert city.ply -o link.csv
  [[ -L link.csv && $(stat -c %a sub/target.csv) == 640 ]] || fail "link or permissions are gone"
  sameBytes sub/target.csv first.csv
  ln -s circle.csv circle.csv
  run 74 convert city.ply -o circle.csv
}

devicesAndPipesAreWrittenTo() {
  generate city.ply --surfels 3k
  run 0 convert city.ply -o file.csv
  run 0 convert city.ply -o file.ply
  ln -s /dev/null null.csv
  run 0 convert city.ply -o null.csv
  [[ -c /dev/null && -L null.csv ]] || fail "the device is gone"
  run 0 index city.ply -o /dev/null
  [[ -c /dev/null ]] || fail "the device is gone"
  mkfifo pipe.csv
  cat pipe.csv > read.csv &
  run 0 convert city.ply -o pipe.csv
  wait
  [[ -p pipe.csv ]] || fail "the FIFO is gone"
  sameBytes read.csv file.csv
  "$surfeit" convert city.ply -q -o - > out.ply
  sameBytes out.ply file.ply
  "$surfeit" convert city.ply -q -o -.csv | cat > out.csv
  sameBytes out.csv file.csv
  echo first > out.csv
  "$surfeit" convert city.ply -q -o -.csv >> out.csv
  [[ $(head -n 1 out.csv) == first ]] || fail "what stood before is gone"
}

inputsMayBePipes() {
  generate city.ply --surfels 3k
  run 0 index city.ply -o city.sft
  "$surfeit" index -q - -o piped.sft < <(cat city.ply)
  "$surfeit" index -q /dev/stdin -o named.sft < <(cat city.ply)
  "$surfeit" index -q - -o file.sft < city.ply
  "$surfeit" convert -q city.ply -o - | "$surfeit" convert -q - -o through.csv
  run 0 convert city.ply -o plain.csv
  sameBytes through.csv plain.csv
  # A FIFO, whose writer comes once
  mkfifo fifo.ply
  cat city.ply > fifo.ply &
  timeout 60 "$surfeit" index -q fifo.ply -o fifo.sft || fail "a FIFO"
  wait
  local scene
  for scene in piped named file fifo; do
    run 0 verify "$scene.sft"
    [[ $("$surfeit" info city.sft | sed -n 's/^ *surfels *//p') == \
      $("$surfeit" info "$scene.sft" | sed -n 's/^ *surfels *//p') ]] || fail "other surfels"
  done
  run 74 index /dev/null -o none.sft
  says "found a device"
  run 74 index . -o none.sft
  says "found a directory"
}

badPlacesAreRefusedFirst() {
  generate city.ply --surfels 3k
  mkdir sub.ply
  run 2 convert city.ply -o sub.ply
  says "is a directory"
  run 2 index city.ply -o ./
  run 74 index city.ply -o nowhere/city.sft
  says "the directory nowhere" "make it first"
  run 74 index city.ply -o city.sft --stats nowhere/stats.json
  [[ ! -e city.sft ]] || fail "worked before it looked at its outputs"
  run 74 index city.ply -o city.ply/city.sft
  local long
  long=$(printf 'x%.0s' {1..260}).ply
  run 74 convert city.ply -o "$long"
  says "shorten it"
  run 74 convert city.ply -o out.ply --stats "$long"
  [[ ! -e out.ply ]] || fail "worked before it looked at its outputs"
  if [[ $(id -u) != 0 ]]; then
    mkdir -m 555 closed
    run 74 index city.ply -o closed/city.sft
    says "cannot write in the directory"
  fi
}

resultsThatWillNotFitAreRefusedFirst() {
  generate city.ply --surfels 300k
  "$surfeit" index -q city.ply -o city.sft
  mkdir small
  mount -t tmpfs -o size=2m none small 2> /dev/null || exit 77
  trap 'umount small' EXIT
  local began
  began=$(date +%s)
  run 74 gather city.sft city.ply -o small/out.ply --quality final
  says "MiB are free in small" "write elsewhere"
  run 74 convert city.ply -o small/out.ply
  (($(date +%s) - began < 20)) || fail "gathered before it looked whether the result will fit"
  [[ -z $(ls small) ]] || fail "left behind: $(ls small)"
}

answersGoToStandardOutput() {
  generate city.ply --surfels 3k
  "$surfeit" index -q city.ply -o city.sft
  local command
  for command in "info city.sft" "info city.ply" "verify city.sft"; do
    # shellcheck disable=SC2086
    [[ -n $("$surfeit" $command 2> error) && ! -s error ]] || fail "no answer: $command"
  done
}

runCase
