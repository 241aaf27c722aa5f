#!/usr/bin/env bash
# Whether two releases of the program write the same bytes: every command over modes, outputs,
# qualities, orders, budgets and threads, on scenes of their own making; of tune, which prints seconds,
# the look-ups that it counts; of budgets that are too small, what is said.
#
#   scripts/compare_releases.sh OLD_SURFEIT NEW_SURFEIT [SCENE_PROGRAM]
#
# SCENE_PROGRAM writes a mesh (examples/cornell_scene); absent: meshes are left out. Prints what
# differs, and how many files are the same; exit status 1 when any differs.
set -euo pipefail
(($# >= 2)) || { sed -n 2,10p "$0" >&2; exit 2; }
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

# compare FILE: of both releases; of the reports of verify and tune, all but what depends on seconds
compare() {
  if [[ $1 == verify.out ]]; then sed -i 's/ in [0-9.]* s$//' "$work"/*/verify.out; fi
  if [[ $1 == tune*.out ]]; then sed -i '/receivers"\|"requests"/!d' "$work"/*/"$1"; fi
  if cmp --silent "$work/old/$1" "$work/new/$1"; then
    same=$((same + 1))
  else
    different=$((different + 1))
    echo "differs: $1"
  fi
}

# refuses STATUS NAME ARGUMENTS...: both releases end with this status, and say the same
refuses() {
  local expected=$1 name=$2 status
  shift 2
  for which in old new; do
    status=0
    (cd "$work/$which" && "${!which}" "$@" --quiet >"$name.out" 2>"$name.err") || status=$?
    if ((status != expected)); then
      echo "ends with $status, not $expected: $which $*: $(head -1 "$work/$which/$name.err")"
      different=$((different + 1))
    fi
  done
  compare "$name.err"
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
makes gather_by_input by_input.ply gather city_1.sft every.ply -o by_input.ply --order input --threads 2 \
  --direct-io --no-prefetch --cache-split .3 --memory 32M
makes gather_uniform uniform.ply gather city_1.sft every.ply -o uniform.ply --distribution uniform \
  --cone-angle .7 --outputs occlusion,bent_normal
makes gather_look look.ply gather city_1.sft every.ply -o look.ply --mode bleeding --bounce-gain .5 \
  --bounce-filter "gain=3 radius=50,300 centre=0,0,0"
makes gather_interpolated_2 interpolated_2.ply gather city_1.sft city.ply -o interpolated_2.ply \
  --mode bleeding --quality draft --max-variation .1 --memory 64M --threads 2
makes gather_spilled spilled.ply gather city_1.sft city.ply -o spilled.ply --quality draft --threads 2 \
  --memory 28M
makes gather_staged staged.ply gather city_1.sft every.ply -o staged.ply --stage stage
makes gather_staged_again staged_again.ply gather city_1.sft every.ply -o staged_again.ply --stage stage
makes gather_resumed resumed.ply gather city_1.sft every.ply -o resumed.ply --resume --resume-parts 3

# The sky: 4 by 2 pixels, each of 4 bytes
for which in old new; do
  {
    printf '#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n'
    printf '\x20\x40\x60\x82%.0s' 1 2 3
    printf '\xf0\xe0\xd0\x84\x10\x20\x30\x80%.0s' 1 2
    printf '\x08\x08\x08\x80'
  } >"$work/$which/sky.hdr"
done
makes gather_sky sky.ply gather city_1.sft every.ply -o sky.ply --mode bleeding --environment sky.hdr \
  --environment-rotation 30 --occlusion-by-brightness
makes gather_glossy_sky glossy_sky.ply gather city_1.sft every.ply -o glossy_sky.ply --mode glossy \
  --camera 0,200,0 --environment sky.hdr --threads 2

# Far from the origin; some surfels a group of their own
for name in city every; do
  makes "far_$name" "far_$name.ply" convert "$name.ply" -o "far_$name.ply" \
    --transform "1 0 0 5e5  0 1 0 -4e6  0 0 1 100  0 0 0 1"
done
makes index_far far.sft index far_city.ply -o far.sft
makes gather_far far_lit.ply gather far.sft far_every.ply -o far_lit.ply --mode glossy \
  --camera 500000,-3999800,100
makes index_named named.sft index city.ply --group few=every.ply -o named.sft
makes gather_subset subset.ply gather named.sft every.ply -o subset.ply --mode bleeding --subset few
makes gather_gain gain.ply gather named.sft every.ply -o gain.ply --mode bleeding --gain few=4

# Several gathers of one scene in a call
for frame in 1 2 3; do
  makes "shot_$frame" "shot.$frame.ply" convert city.ply -o "shot.$frame.ply" --every $((30 + frame))
done
both gather_frames gather city_1.sft shot.#.ply -o shot_lit.#.ply --mode bleeding --memory 48M --frames 1-3
for frame in 1 2 3; do compare "shot_lit.$frame.ply"; done

makes bounce bounced.sft bounce city_1.sft -o bounced.sft --bounces 2 --quality draft
makes bounce_again again.sft bounce city_1.sft -o again.sft --bounces 2 --quality draft --memory 64M --threads 2
makes bounce_spared spared.sft bounce city_1.sft -o spared.sft --bounces 2 --quality draft \
  --surfels-per-receiver 8 --spare-last
makes bounce_glossy lobes.sft bounce named.sft -o lobes.sft --quality draft --glossy 0=.7,.3
makes gather_lobes of_lobes.ply gather lobes.sft every.ply -o of_lobes.ply --mode bleeding --threads 2 \
  --memory 48M
makes bounce_look bounced_look.sft bounce named.sft -o bounced_look.sft --quality draft --bounce-gain .7 \
  --group-gain few=3 --sides both
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
for shard in 1 2; do
  both "shard_in_2_threads_$shard" gather city_1.sft every.ply -o parted.ply --shard $shard/2 --threads 2 \
    --memory 48M
done
makes merge_parted parted.ply merge city_1.sft every.ply -o parted.ply
makes index_merge parts.sft index city.ply -o parts.sft --pass merge --shards 2
makes relight relit.sft relight city_1.sft -o relit.sft --light-point "0 200 0 9 9 9"
makes cube cube.exr cube city_1.sft --receivers every.ply --number 7 -o cube.exr --mode bleeding
makes cube_glossy cube_glossy.exr cube city_1.sft --receivers every.ply --number 9 -o cube_glossy.exr \
  --mode glossy --camera 0,200,0
makes cube_far cube_far.exr cube far.sft --receivers far_every.ply --number 9 -o cube_far.exr
makes ptfilter filtered.ply ptfilter -filter occlusion -maxsolidangle .1 every.ply -o filtered.ply
both plan plan city_1.sft every.ply -o planned.ply --shards 2 --memory 64M --time 30m --slurm
both tune tune city_1.sft every.ply --threads 1 --json --mode bleeding
both tune_sampled tune city_1.sft city.ply --threads 2 --json --sample 6000
refuses 33 gather_in_little gather city_1.sft every.ply -o little.ply --memory 8M --threads 2
refuses 33 bounce_in_little bounce city_1.sft -o little.sft --memory 8M --threads 2
refuses 33 cube_in_little cube city_1.sft --receivers every.ply --number 7 -o little.exr --memory 8M
refuses 33 tune_in_little tune city_1.sft every.ply --memory 8M --threads 2
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
