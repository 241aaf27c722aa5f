#!/usr/bin/env bash
# Whether two releases of the program write the same bytes: every command but tune, which prints
# seconds, over modes, outputs, qualities, orders, budgets and threads, on scenes of their own making.
#
#   scripts/compare_releases.sh OLD_SURFEIT NEW_SURFEIT [SCENE_PROGRAM]
#
# SCENE_PROGRAM writes a mesh (examples/cornell_scene); absent: meshes are left out. Prints what
# differs, and how many files are the same; exit status 1 when any differs.
set -euo pipefail
(($# >= 2)) || { sed -n 2,9p "$0" >&2; exit 2; }
old=$(readlink -f "$1") new=$(readlink -f "$2")
scene_program=${3:+$(readlink -f "$3")}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
same=0 different=0

# both NAME ARGUMENTS...: runs both releases, each in a directory of its own, with outputs below NAME
both() {
  local name=$1 status
  shift
  for which in old new; do
    mkdir -p "$work/$which"
    status=0
    (cd "$work/$which" && "${!which}" "$@" --quiet >"$name.out" 2>"$name.err") || status=$?
    echo "$status" >"$work/$which/$name.status"
    if ((status != 0)); then
      echo "fails: $which $*: $(head -1 "$work/$which/$name.err")"
      different=$((different + 1))
    fi
  done
  compare "$name.out"
}

# compare FILE: of both releases; of the report of verify, all but its seconds
compare() {
  if [[ $1 == verify.out ]]; then sed -i 's/ in [0-9.]* s$//' "$work"/*/verify.out; fi
  if cmp --silent "$work/old/$1" "$work/new/$1"; then
    same=$((same + 1))
  else
    different=$((different + 1))
    echo "differs: $1"
  fi
}

# makes NAME FILE ARGUMENTS...: a command that writes FILE
makes() {
  local name=$1 file=$2
  shift 2
  both "$name" "$@"
  compare "$file"
}

makes cloud city.ply generate -o city.ply --surfels 60k --threads 1
for threads in 1 2; do
  makes "index_$threads" "city_$threads.sft" index city.ply -o "city_$threads.sft" --threads $threads
done
makes index_full full.sft index city.ply -o full.sft --precision full
makes index_small small.sft index city.ply -o small.sft --memory 96M --threads 1
makes bare bare.ply convert city.ply -o bare.ply --keep position
makes index_bare bare.sft index bare.ply -o bare.sft
makes index_normals normals.sft index bare.ply -o normals.sft --normals estimate --orient up
makes normals normals.ply normals bare.ply -o normals.ply
makes every every.ply convert city.ply -o every.ply --every 20
makes spacing spacing.xyz convert city.ply -o spacing.xyz --spacing 20
for format in ptc las prt bgeo pdb vdb csv; do
  makes "to_$format" "every.$format" convert every.ply -o "every.$format"
done

for mode in occlusion bleeding; do
  for quality in draft standard; do
    makes "gather_${mode}_$quality" "$mode.$quality.ply" \
      gather city_1.sft every.ply -o "$mode.$quality.ply" --mode $mode --quality $quality
  done
done
makes gather_final final.ply gather city_1.sft spacing.xyz -o final.ply --mode bleeding --quality final
makes gather_glossy glossy.ply \
  gather city_1.sft every.ply -o glossy.ply --mode glossy --camera 0,200,0 --roughness .3
makes gather_outputs outputs.ply gather city_1.sft every.ply -o outputs.ply --mode bleeding \
  --outputs occlusion,irradiance,bent_normal,illumination_direction,fluence,radiance_sh
for order in hilbert morton input; do
  makes "gather_$order" "order_$order.ply" gather city_1.sft every.ply -o "order_$order.ply" --order $order
done
for memory in 64M 512M; do
  for threads in 1 2; do
    makes "gather_${memory}_$threads" "gather_${memory}_$threads.ply" gather city_1.sft every.ply \
      -o "gather_${memory}_$threads.ply" --mode bleeding --memory $memory --threads $threads
  done
done
makes gather_interpolated interpolated.ply \
  gather city_1.sft every.ply -o interpolated.ply --mode bleeding --max-variation .02
makes gather_fading fading.ply gather city_1.sft every.ply -o fading.ply --falloff .01 --max-dist 500
makes gather_sides sides.ply gather city_1.sft every.ply -o sides.ply --mode bleeding --sides both
makes bounce bounced.sft bounce city_1.sft -o bounced.sft --bounces 2 --quality draft
makes brick values.vdb brick bleeding.draft.ply -o values.vdb
makes cloud_of_scene scene.ply convert city_1.sft -o scene.ply
makes lookup looked_up.ply lookup bleeding.draft.ply every.ply -o looked_up.ply
makes lookup_brick looked_up_brick.ply lookup values.vdb every.ply -o looked_up_brick.ply
for shard in 1 2 3; do
  makes "shard_$shard" "sharded.ply.shard-$shard-of-3" \
    gather city_1.sft every.ply -o sharded.ply --shard $shard/3 --mode bleeding --quality draft \
    --threads 1  # several write what they have gathered as soon as they have it
done
makes merge sharded.ply merge city_1.sft every.ply -o sharded.ply
for pass in count distribute build; do
  for shard in 1 2; do
    both "index_${pass}_$shard" index city.ply -o parts.sft --pass $pass --shard $shard/2
  done
done
makes index_merge parts.sft index city.ply -o parts.sft --pass merge --shards 2
makes relight relit.sft relight city_1.sft -o relit.sft --light-point "0 200 0 9 9 9"
makes cube cube.exr cube city_1.sft --receivers every.ply --number 7 -o cube.exr --mode bleeding
makes ptfilter filtered.ply ptfilter -filter occlusion -maxsolidangle .1 every.ply -o filtered.ply
both plan plan city_1.sft every.ply -o planned.ply --shards 2 --memory 64M --time 30m --slurm
both info info city_1.sft
both info_cloud info every.ply
both verify verify city_1.sft

if [[ -n ${scene_program:-} ]]; then
  for which in old new; do (cd "$work/$which" && "$scene_program" .); done
  mesh=$(cd "$work/old" && ls ./*.obj | head -1)
  makes sample sampled.ply sample "$mesh" -o sampled.ply --count 30000 --light-point "0 1.5 0 1 1 1"
  makes index_sampled sampled.sft index sampled.ply -o sampled.sft
  makes gather_sampled baked.ply gather sampled.sft sampled.ply -o baked.ply --mode bleeding
  makes view picture.png view baked.ply -o picture.png --size 200x200
  makes passes passes.exr view sampled.ply -o unused.png --passes passes.exr --size 200x200
  makes gather_passes lit.exr gather sampled.sft passes.exr -o lit.exr --mode bleeding --quality draft
  makes composite composed.png composite passes.exr lit.exr -o composed.png
  makes photons photons.ply sample "$mesh" -o photons.ply --photons 20000 --light-point "0 1.5 0 1 1 1"
  makes radiance radiance.ply radiance photons.ply -o radiance.ply
fi
echo "$same files the same, $different different"
((different == 0))
