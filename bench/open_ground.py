#!/usr/bin/env python3
"""Occlusion of open ground in airborne scans: with estimated normals, and as spheres.

    PYTHONPATH=build/dev/python python3 bench/open_ground.py CLOUD ... [--quality draft]
        [--rounds 5] [--directory DIR]

Indexes each cloud twice, with `normals=estimate` turned up and without normals, and gathers
occlusion at the points of both, in turns. Receivers are the points with their estimated normals.
Heights alone tell open ground: a point lies on it where all points of the cells around it, a window
of 20 by 20 spacings, lie within 2 spacings of height. Only what stands farther away covers its sky.
"""

import argparse
import os
import statistics
import tempfile
import time
import warnings

import numpy as np

import surfeit

CELL = 4  # spacings; the window is 5 by 5 cells
WINDOW = 2  # cells on each side
MOST_HEIGHT = 2  # spacings


def open_ground(position):
    """Whether each point lies on open ground."""
    position = position - position.min(axis=0)
    extent = position.max(axis=0)
    occupied = np.unique((position[:, :2] / (extent[:2].max() / 256)).astype(int), axis=0)
    area = len(occupied) * (extent[:2].max() / 256) ** 2
    spacing = float(np.sqrt(area / len(position)))
    cell = (position[:, :2] / (CELL * spacing)).astype(int) + WINDOW
    shape = cell.max(axis=0) + 1 + WINDOW
    low, high = np.full(shape, np.inf), np.full(shape, -np.inf)
    np.minimum.at(low, tuple(cell.T), position[:, 2])
    np.maximum.at(high, tuple(cell.T), position[:, 2])
    steps = range(-WINDOW, WINDOW + 1)
    around = [(i, j) for i in steps for j in steps]
    lowest = np.min([np.roll(low, step, (0, 1)) for step in around], axis=0)
    highest = np.max([np.roll(high, step, (0, 1)) for step in around], axis=0)
    missing = np.max([np.roll(np.isinf(low), step, (0, 1)) for step in around], axis=0)
    is_open = (highest - lowest < MOST_HEIGHT * spacing) & ~missing
    return is_open[tuple(cell.T)]


def measure(cloud, options, directory):
    normals = os.path.join(directory, "normals.ply")
    surfeit.normals(cloud, normals, toward="up")
    scenes = {"normals": os.path.join(directory, "normals.sft"),
              "spheres": os.path.join(directory, "spheres.sft")}
    surfeit.index(cloud, scenes["normals"], normals="estimate", toward="up")
    surfeit.index(cloud, scenes["spheres"])
    points = surfeit.read(normals)
    position = np.asarray(points["position"], dtype=np.float64)
    is_open = open_ground(position)

    seconds = {name: [] for name in scenes}
    occlusion = {}
    for _ in range(options.rounds):
        for name, scene in scenes.items():
            engine = surfeit.Engine(memory="512M", threads=1)
            start = time.process_time()
            result = engine.open(scene).gather(
                position, points["normal"], mode="occlusion", quality=options.quality)
            seconds[name].append(time.process_time() - start)
            occlusion[name] = result["occlusion"]
    for name in scenes:
        ground = occlusion[name][is_open]
        rate = len(position) / statistics.median(seconds[name])
        print(f"| {os.path.basename(cloud)} | {name} | {len(position)} | {is_open.mean():.2f} "
              f"| {np.median(ground):.4f} | {np.quantile(ground, .9):.4f} | {rate:.0f} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clouds", nargs="+")
    parser.add_argument("--quality", default="draft", choices=["draft", "standard", "final"])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--directory", help="for temporary files")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    print("| Cloud | Gathered with | Points | Open part | Occlusion of it, median | 90 % below "
          "| Receivers per processor second |")
    print("|---|---|--:|--:|--:|--:|--:|")
    for cloud in options.clouds:
        with tempfile.TemporaryDirectory(dir=options.directory) as directory:
            measure(cloud, options, directory)


if __name__ == "__main__":
    main()
