"""Progress, Ctrl-C, threads, pickles, leaks and memory."""

import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest

import surfeit
from conftest import cloud_of


def resident_bytes():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def processor_seconds(pid):
    with open(f"/proc/{pid}/stat") as file:
        user, system = file.read().rsplit(")", 1)[1].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def test_progress_counts_to_the_end(scene, receivers, tmp_path):
    seen = []
    scene.gather(*receivers, progress=lambda *now: seen.append(now), max_solid_angle=0.01)
    assert seen[-1] == ("gather", 5000, 5000, "receivers")
    counts = [done for _, done, _, _ in seen]
    assert counts == sorted(counts)
    surfeit.convert(scene.path, tmp_path / "a.ply", progress=lambda *now: seen.append(now))
    assert len({phase for phase, *_ in seen}) > 1
    scene.gather(*receivers, progress=True, quality="draft")  # tqdm, or nothing


def test_what_progress_raises_stops_the_work(scene, receivers, tmp_path):
    def stop(phase, done, total, unit):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        scene.gather(*receivers, progress=stop, max_solid_angle=0.005)
    with pytest.raises(LookupError, match="enough"):
        surfeit.bounce(scene, tmp_path / "b.sft", 3, progress=stop)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("call", [
    "engine.open(path).gather(P, N, max_solid_angle=0)",
    "engine.gatherer(engine.open(path), max_solid_angle=0).gather(P, N, order='input')",
    "surfeit.bounce(path, path + '.b.sft', 50, max_solid_angle=0)",
])
def test_ctrl_c_stops_within_half_a_second(scene_path, call, tmp_path):
    code = textwrap.dedent(f"""
        import sys, time, numpy as np, surfeit
        path = {str(scene_path)!r}
        cloud = surfeit.read(path)
        P, N = np.tile(cloud["position"], (20, 1)), np.tile(cloud["normal"], (20, 1))
        engine = surfeit.Engine(memory="256M", threads=2)
        print("ready", flush=True)
        try:
            {call}
        except KeyboardInterrupt:
            print("stopped", time.time(), time.process_time(), flush=True)
    """)
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout.readline() == "ready\n"
        time.sleep(1)
        sent, sent_cpu = time.time(), processor_seconds(child.pid)
        child.send_signal(signal.SIGINT)
        word, at, cpu = child.stdout.readline().split()
    assert word == "stopped"
    # On a busy machine others have the processors; then what two threads have done meanwhile counts
    latency, busy = float(at) - sent, (float(cpu) - sent_cpu) / 2
    print(f"stopped after {latency:.2f} s, {busy:.2f} s of each processor")
    assert min(latency, busy) < 0.5
    assert not os.path.exists(f"{scene_path}.b.sft")


def test_threads_gather_at_once_and_alike(engine, scene, receivers):
    expected = scene.gather(*receivers, threads=1, mode="bleeding")
    found = [None] * 4

    def gather(i):
        found[i] = scene.gather(*receivers, threads=1, mode="bleeding")

    threads = [threading.Thread(target=gather, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for results in found:
        assert np.array_equal(results["irradiance"], expected["irradiance"])

    gatherer = engine.gatherer(scene)
    other = gatherer.another()
    assert np.array_equal(gatherer.gather(*receivers)["occlusion"],
                          other.gather(*receivers)["occlusion"])
    gatherer.pause()


def test_python_runs_on_while_a_gather_runs(scene, receivers):
    ticks = []
    has_ended = threading.Event()

    def tick():
        while not has_ended.wait(0.005):
            ticks.append(time.perf_counter())

    ticker = threading.Thread(target=tick)
    ticker.start()
    begin = time.perf_counter()
    scene.gather(*receivers, max_solid_angle=0.005)
    seconds = time.perf_counter() - begin
    has_ended.set()
    ticker.join()
    # 200 a second on an idle machine
    assert len(ticks) > 10 * seconds


def test_two_threads_do_more_than_one(scene, receivers):
    """The GIL is released: a second thread adds its processor. Prints the ratio."""
    positions, normals = np.tile(receivers[0], (4, 1)), np.tile(receivers[1], (4, 1))

    def seconds(count):
        work = lambda: scene.gather(positions, normals, threads=1)  # noqa: E731
        threads = [threading.Thread(target=work) for _ in range(count)]
        begin = time.perf_counter()
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        return time.perf_counter() - begin

    seconds(2)
    ratio = max(2 * seconds(1) / seconds(2) for _ in range(3))
    print(f"two threads gather {ratio:.2f} x one")
    if os.cpu_count() < 2 or os.getloadavg()[0] > 1.5:
        pytest.skip(f"{ratio:.2f} x one, on a busy machine or one processor")
    assert ratio > 1.25  # 1 while the GIL is held


def test_handles_pickle(engine, scene, receivers, scene_path):
    assert pickle.loads(pickle.dumps(engine)) is engine
    moved = scene.placed([[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 0]])
    again = pickle.loads(pickle.dumps(moved))
    assert again.engine is engine and again.path == str(scene_path)
    assert np.array_equal(again.transform, moved.transform)
    scenes = engine.stats["scenes"]
    copies = [pickle.loads(pickle.dumps(scene)) for _ in range(10)]
    assert engine.stats["scenes"] <= scenes + 1 and copies[0].info == scene.info


def _gather_mean(scene, positions, normals):
    return float(scene.gather(positions, normals, threads=1)["occlusion"].mean())


def test_other_processes_get_scenes(scene, receivers):
    expected = _gather_mean(scene, *receivers)
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        found = pool.starmap(_gather_mean, [(scene, *receivers)] * 3)
    assert found == [expected] * 3


def test_ten_thousand_calls_leak_nothing(scene, scene_path, engine, receivers):
    positions, normals = receivers[0][:16], receivers[1][:16]
    gatherer = engine.gatherer(scene, quality="draft")

    def calls(count):
        for i in range(count):
            gatherer.gather(positions, normals)
            if i % 10 == 0:
                scene.gather(positions, normals, quality="draft", outputs=["occlusion"])
                engine.stats
            if i % 100 == 0:
                engine.open(scene_path).info
                with pytest.raises(ValueError):
                    scene.gather(positions[:, :2])

    calls(1000)
    before = resident_bytes()
    calls(10_000)
    assert resident_bytes() - before < 4 << 20


def test_memory_is_budget_and_arrays(tmp_path):
    """In a process of its own: 200,000 points in and out within 64 MiB and their arrays."""
    cloud = cloud_of(200_000)
    np.savez(tmp_path / "cloud.npz", P=cloud["position"], N=cloud["normal"], area=cloud["area"])
    code = textwrap.dedent(f"""
        import numpy as np, surfeit
        from surfeit import _surfeit
        cloud = np.load({str(tmp_path / "cloud.npz")!r})
        P, N, area = cloud["P"], cloud["N"], cloud["area"]
        beginning = _surfeit.peak_resident()
        surfeit.index({{"position": P, "normal": N, "area": area}},
                      {str(tmp_path / "a.sft")!r}, memory="64M", threads=2)
        indexed = _surfeit.peak_resident()
        scene = surfeit.Engine(memory="64M", threads=2).open({str(tmp_path / "a.sft")!r})
        found = scene.gather(P, N, quality="draft", outputs=["occlusion", "bent_normal"])
        arrays = sum(array.nbytes for array in found.values())
        print(len(P), beginning, indexed, _surfeit.peak_resident(), arrays)
    """)
    count, beginning, indexed, gathered, arrays = map(int, subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code], check=True, capture_output=True,
        text=True).stdout.split())
    mega = 1 << 20
    print(f"{count} points: {beginning / mega:.0f} MiB before, {indexed / mega:.0f} after index, "
          f"{gathered / mega:.0f} after gather; results {arrays / mega:.0f}")
    slack = 24 * mega  # threads' stacks, libraries that are loaded on use
    assert indexed - beginning < 64 * mega + slack
    assert gathered - beginning < 64 * mega + slack + arrays
