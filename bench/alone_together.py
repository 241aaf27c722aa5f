#!/usr/bin/env python3
"""What a receiver gets beside others, and alone.

    PYTHONPATH=build/dev/python python3 bench/alone_together.py CLOUD ... [--part .3]
        [--probes 800] [--quality standard]

Indexes each cloud, gathers bleeding at a part of its surfels, chosen by chance, in one call, and at
some of these each in a call of its own, which defines the result. Prints the rates of both, by
processor time, and the differences: of occlusion, and of irradiance over its mean.
"""

import argparse
import os
import tempfile
import time

import numpy as np

import surfeit

OUTPUTS = ["occlusion", "irradiance"]


def timed(call):
    """Seconds of the processor, and what the call returns."""
    start = time.process_time()
    result = call()
    return time.process_time() - start, result


def compare(cloud, arguments, directory):
    scene_path = os.path.join(directory, "scene.sft")
    surfeit.index(cloud, scene_path)
    surfels = surfeit.read(cloud)
    random = np.random.default_rng(1)
    count = len(surfels["position"])
    chosen = random.choice(count, max(1, round(arguments.part * count)), replace=False)
    positions, normals = surfels["position"][chosen], surfels["normal"][chosen]
    scene = surfeit.Engine(memory=arguments.memory).open(scene_path)

    def gather(some):
        results = scene.gather(positions[some], normals[some], mode="bleeding",
                               quality=arguments.quality, outputs=OUTPUTS)
        return results["occlusion"], results["irradiance"].mean(axis=1)

    probes = random.choice(len(chosen), min(arguments.probes, len(chosen)), replace=False)
    together_time, together = timed(lambda: gather(slice(None)))
    alone_time, alone = timed(lambda: [gather(slice(i, i + 1)) for i in probes])
    occlusion = together[0][probes] - [float(one[0][0]) for one in alone]
    light_alone = np.array([float(one[1][0]) for one in alone])
    light = (together[1][probes] - light_alone) / max(light_alone.mean(), 1e-30)
    print(f"{os.path.basename(cloud)}: {len(chosen)} receivers, {len(chosen) / together_time:.0f} /s "
          f"together, {len(probes) / alone_time:.0f} /s alone")
    for name, off in ("occlusion", occlusion), ("light", light):
        median, most = np.quantile(np.abs(off), [0.5, 1])
        print(f"  {name:9}  rms {np.sqrt((off ** 2).mean()):.4f}  median {median:.4f}  "
              f"most {most:.3f}  bias {off.mean():+.4f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("clouds", nargs="+", metavar="CLOUD")
    parser.add_argument("--part", type=float, default=0.3, help="of the surfels that are receivers")
    parser.add_argument("--probes", type=int, default=800, help="receivers gathered alone, too")
    parser.add_argument("--quality", default="standard")
    parser.add_argument("--memory", default="1G")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as directory:
        for cloud in arguments.clouds:
            compare(cloud, arguments, directory)


if __name__ == "__main__":
    main()
