#!/usr/bin/env python3
"""What receivers in arrays cost on the way over files, and threads of Python against one.

    PYTHONPATH=build/release/python python3 bench/python_cost.py [--receivers 1k,100k,10M]
        [--surfels 1M] [--memory 512M] [--quality coarse] [--directory DIR]
    PYTHONPATH=build/release/python python3 bench/python_cost.py --points 10M [--quality coarse]

Prints a table in Markdown. Both ways open the scene; files also write the receivers and read the
result. The scene is hills of surfels of known size; receivers are surfels of it in random order.

With --points, a process of its own indexes so many points from arrays and gathers at them, and the
table tells what it held: the arrays, and the most resident memory after each step.
"""

import argparse
import multiprocessing
import os
import platform
import tempfile
import threading
import time
import warnings

import numpy as np

import surfeit
from surfeit import _surfeit

UNITS = {"k": 1000, "M": 1_000_000}
CHUNK = 500_000  # points whose numbers are made at a time

# Of gathers. "coarse" is for many receivers on a slow machine: cheap, and good for no picture
QUALITIES = {
    **{name: {"quality": name} for name in ("draft", "standard", "final")},
    "coarse": {"max_solid_angle": 1.0, "raster_resolution": 4, "near_field_radii": 1.0},
}


def count_of(text):
    return int(float(text[:-1]) * UNITS[text[-1]]) if text[-1] in UNITS else int(text)


def hills(count, seed):
    """Positions and normals, float32, on a square of 100 by 100. Holds little beside them."""
    rng = np.random.default_rng(seed)
    positions, normals = np.empty((2, count, 3), np.float32)
    for begin in range(0, count, CHUNK):
        end = min(count, begin + CHUNK)
        positions[begin:end], normals[begin:end] = part_of_hills(end - begin, rng)
    return positions, normals


def part_of_hills(count, rng):
    x, z = rng.uniform(0, 100, (2, count))
    y = 2 * np.sin(0.5 * x) * np.cos(0.4 * z)
    slope_x = np.cos(0.5 * x) * np.cos(0.4 * z)
    slope_z = -0.8 * np.sin(0.5 * x) * np.sin(0.4 * z)
    normals = np.stack([-slope_x, np.ones(count), -slope_z], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.stack([x, y, z], axis=1), normals


def seconds_of(work):
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def both_seconds_of(work):
    """Wall time and processor time of all threads. On a busy machine only the second one tells."""
    cpu = time.process_time()
    return seconds_of(work), time.process_time() - cpu


def by_arrays(scene, positions, normals, memory, settings):
    opened = surfeit.Engine(memory=memory).open(scene)
    return opened.gather(positions, normals, **settings)["occlusion"]


def by_files(scene, positions, normals, memory, settings):
    surfeit.write("receivers.ply", {"position": positions, "normal": normals})
    surfeit.gather(scene, "receivers.ply", "result.ply", memory=memory, **settings)
    return surfeit.read("result.ply", only="occlusion")["occlusion"]


def print_costs(sizes, memory, settings):
    print("| receivers | arrays, s | files, s | arrays, CPU s | files, CPU s | files on disk, MB |")
    print("|---|---|---|---|---|---|")
    for size in sizes:
        positions, normals = hills(count_of(size), 2)
        results = {}
        times = {}
        for way in (by_arrays, by_files):
            times[way] = min(
                both_seconds_of(
                    lambda: results.update(
                        {way: way("scene.sft", positions, normals, memory, settings)})
                )
                for _ in range(3 if count_of(size) < 1_000_000 else 1)
            )
        assert np.array_equal(results[by_arrays], results[by_files])
        disk = sum(os.path.getsize(name) for name in ("receivers.ply", "result.ply")) / 1e6
        (arrays, arrays_cpu), (files, files_cpu) = times[by_arrays], times[by_files]
        print(f"| {size} | {arrays:.2f} | {files:.2f} | {arrays_cpu:.2f} | {files_cpu:.2f} "
              f"| {disk:.1f} |", flush=True)


def points_in_and_out(connection, count, memory, settings):
    """In a process of its own: resident bytes and seconds of each step."""
    warnings.simplefilter("ignore", surfeit.DataWarning)
    steps = []

    def step(name, work):
        seconds, cpu = both_seconds_of(work)
        steps.append((name, seconds, cpu, _surfeit.peak_resident()))

    held = {}
    step("arrays in", lambda: held.update(P=hills(count, 1)))
    positions, normals = held["P"]
    held["area"] = np.full(count, 1.3e4 / count, np.float32)
    cloud = {"position": positions, "normal": normals, "area": held["area"]}
    step("index", lambda: surfeit.index(cloud, "points.sft", memory=memory))
    scene = surfeit.Engine(memory=memory).open("points.sft")
    step("gather", lambda: held.update(scene.gather(positions, normals, **settings)))
    arrays = sum(array.nbytes for array in (positions, normals, held["area"], held["occlusion"]))
    assert np.isfinite(held["occlusion"]).all()
    connection.send((arrays, steps))


def print_points(count, memory, settings):
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    child = context.Process(target=points_in_and_out, args=(theirs, count, memory, settings))
    child.start()
    theirs.close()
    arrays, steps = ours.recv()
    child.join()
    print(f"arrays {arrays / 2**20:.0f} MiB in and out, scene "
          f"{os.path.getsize('points.sft') / 2**20:.0f} MiB\n")
    print("| step | s | CPU s | most resident, MiB |\n|---|---|---|---|")
    for name, seconds, cpu, resident in steps:
        print(f"| {name} | {seconds:.0f} | {cpu:.0f} | {resident / 2**20:.0f} |")


def print_calls(memory):
    """Small calls on one gatherer against one call of all, and the call through the scene."""
    positions, normals = hills(1_000_000, 3)
    order = np.lexsort((positions[:, 0] // 2, positions[:, 2] // 2))[:25_600]
    positions, normals = positions[order], normals[order]
    engine = surfeit.Engine(memory=memory)
    scene = engine.open("scene.sft")
    gatherer = engine.gatherer(scene)

    def calls(gather):
        for begin in range(0, len(positions), 256):
            gather(positions[begin:begin + 256], normals[begin:begin + 256])

    whole = seconds_of(lambda: gatherer.gather(positions, normals, order="input"))
    whole = min(whole, seconds_of(lambda: gatherer.gather(positions, normals, order="input")))
    small = min(seconds_of(lambda: calls(lambda *at: gatherer.gather(*at, order="input")))
                for _ in range(2))
    scenes = min(seconds_of(lambda: calls(lambda *at: scene.gather(*at))) for _ in range(2))
    print(f"\n100 calls of 256 receivers over one call: {small / whole:.2f} on a gatherer, "
          f"{scenes / whole:.2f} on a scene, sorting included")


def print_threads(memory):
    """Two threads of Python, with one of the library each, and two threads of the library."""
    positions, normals = hills(40_000, 4)
    scene = surfeit.Engine(memory=memory, threads=2).open("scene.sft")

    def gather(count):
        threads = [threading.Thread(target=lambda: scene.gather(positions, normals, threads=1))
                   for _ in range(count)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    gather(2)
    one, two, library = zip(*(
        (both_seconds_of(lambda: gather(1)), both_seconds_of(lambda: gather(2)),
         both_seconds_of(lambda: scene.gather(positions, normals, threads=2))) for _ in range(3)))
    one, two, library = (np.median(times, axis=0) for times in (one, two, library))
    print(f"two threads of Python gather {2 * one[0] / two[0]:.2f} x one, the library's "
          f"{one[0] / library[0]:.2f} x (medians of 3); by processor time, if both have one of "
          f"their own, {4 * one[1] / two[1]:.2f} x and {2 * one[1] / library[1]:.2f} x")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--receivers", default="1k,100k,10M")
    parser.add_argument("--surfels", default="1M")
    parser.add_argument("--memory", default="512M")
    parser.add_argument("--quality", default="standard", choices=QUALITIES)
    parser.add_argument("--points", help="points to index from arrays and to gather at")
    parser.add_argument("--directory", help="for temporary files")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", surfeit.DataWarning)
    with tempfile.TemporaryDirectory(dir=arguments.directory) as directory:
        os.chdir(directory)
        settings = QUALITIES[arguments.quality]
        print(f"surfeit {surfeit.__version__}, {platform.processor() or platform.machine()}, "
              f"{len(os.sched_getaffinity(0))} processors, load {os.getloadavg()[0]:.1f}; "
              f"budget {arguments.memory}, {arguments.quality}\n")
        if arguments.points:
            print_points(count_of(arguments.points), arguments.memory, settings)
            os.chdir("/")
            return
        count = count_of(arguments.surfels)
        positions, normals = hills(count, 1)
        area = np.full(count, 1.3e4 / count, np.float32)
        surfeit.index({"position": positions, "normal": normals, "area": area}, "scene.sft")
        print(f"{arguments.surfels} surfels\n")
        print_costs(arguments.receivers.split(","), arguments.memory, settings)
        print_calls(arguments.memory)
        print_threads(arguments.memory)
        os.chdir("/")


if __name__ == "__main__":
    main()
