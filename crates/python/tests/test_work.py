"""Long work leaves the interpreter to others, can be ended, tells how far it is, and shares one pool of threads."""

import gc
import multiprocessing
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import dioptric as dp
import numpy as np
import pytest


def fresh(tiny: dp.Camera, **change: object) -> dp.Camera:
    """Returns a camera of which nothing is kept."""
    return dp.Camera.from_ron(tiny.with_(**change).to_ron())


def longer(tiny: dp.Camera, pixels: tuple[int, int] = (240, 160), pixel_um: float = 132) -> dp.Camera:
    """A camera whose picture takes a second or more."""
    scene = dp.Scene.target("checkerboard", 300, 200, fov_deg=36, depth_m=1.2)
    return fresh(
        tiny, scene=scene, pixels=pixels, pixel_um=pixel_um, wavelengths_nm=list(range(400, 701, 10)), f_number=2.8
    )


def test_threads_share_the_pool(tiny: dp.Camera) -> None:
    """Four threads at once, each its own camera: all end, and each has the picture that it has alone."""
    cameras = [fresh(tiny, focus_mm=800 + 100 * i) for i in range(4)]
    with ThreadPoolExecutor(4) as threads:
        together = [future.result(timeout=120) for future in [threads.submit(camera.render) for camera in cameras]]
    for camera, shot in zip(cameras, together):
        assert shot.png() == fresh(camera).render().png()


def test_results_do_not_depend_on_threads(tiny: dp.Camera) -> None:
    before = dp.threads()
    try:
        pictures = []
        for n in (1, 3):
            dp.set_threads(n)
            assert dp.threads() == n
            pictures.append(fresh(tiny).render().irradiance)
        assert np.array_equal(*pictures)
    finally:
        dp.set_threads(before)
    with pytest.raises(ValueError, match="n is 100000, expected 0 to 4096 threads"):
        dp.set_threads(100_000)


def test_other_threads_run_meanwhile(tiny: dp.Camera) -> None:
    turns = 0
    done = threading.Event()

    def count() -> None:
        nonlocal turns
        while not done.is_set():
            turns += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    start = time.perf_counter()
    longer(tiny, (240, 40)).render()
    elapsed = time.perf_counter() - start
    done.set()
    thread.join()
    # A thread that waited for the lock would have had none of them.
    assert turns > 20 * elapsed


def test_follower_is_told_every_stage(tiny: dp.Camera) -> None:
    told: list[tuple[str, float]] = []
    callers = set()

    def follow(stage: str, fraction: float) -> None:
        told.append((stage, fraction))
        callers.add(threading.get_ident())

    longer(tiny, (240, 40)).render(progress=follow)
    assert callers == {threading.get_ident()}
    assert all(0 <= fraction <= 1 for _, fraction in told) and len(told) > 2
    assert told[-1] == ("developing the picture", 1.0)


def test_bar_is_shown_and_closed(tiny: dp.Camera, capsys: pytest.CaptureFixture[str]) -> None:
    fresh(tiny).render(progress=True)
    assert capsys.readouterr().err.strip()
    with pytest.raises(TypeError, match="progress is"):
        tiny.render(progress="yes")  # type: ignore[arg-type]


def test_exception_of_a_follower_ends_the_work(tiny: dp.Camera) -> None:
    def refuse(stage: str, fraction: float) -> None:
        raise KeyError(stage)

    camera = longer(tiny)
    start = time.perf_counter()
    with pytest.raises(KeyError):
        camera.render(progress=refuse)
    assert time.perf_counter() - start < 2
    assert camera.stage_counts()["irradiance"] == 0


@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX's")
def test_ctrl_c_ends_the_work(tiny: dp.Camera) -> None:
    camera = longer(tiny, (960, 640), 33)
    # A shell starts what runs in the background with the signal ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    start = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        camera.render()
    assert time.perf_counter() - start < 3
    # What was interrupted can be done again.
    assert fresh(tiny).render().png() == tiny.render().png()


@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX's")
@pytest.mark.parametrize("what", ["psf", "analyze"])
def test_ctrl_c_ends_the_work_of_a_lens(what: str) -> None:
    lens = dp.Lens.built_in("dgauss-50mm").with_stop(f_number=2.8)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    start = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        if what == "psf":
            lens.psf(field_deg=np.linspace(0, 14, 200), wavelengths_nm=np.arange(400, 700, 2), diffraction="wave", shape=65)
        else:
            lens.analyze(fields_deg=np.linspace(0, 14, 60), wavelengths_nm=np.arange(400, 700, 10), rings=12)
    # Seconds are for a busy machine: it is interrupted at once, and what is under way ends with its rays.
    assert time.perf_counter() - start < 3
    assert lens.psf(shape=9).shape == (9, 9)


def picture_of(text: str) -> bytes:
    """In another process."""
    return dp.Camera.from_ron(text).render().png()


def test_spawned_process_renders(tiny: dp.Camera) -> None:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply_async(picture_of, (tiny.to_ron(),)).get(timeout=120) == tiny.render().png()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="fork is POSIX's")
def test_forked_process_renders_after_use(tiny: dp.Camera) -> None:
    """The child has none of the parent's threads, and makes its own."""
    own = tiny.render().png()
    script = """
        import multiprocessing, sys, warnings
        import dioptric as dp
        warnings.simplefilter("ignore")
        def picture(text):
            return dp.Camera.from_ron(text).render().png()
        text = open(sys.argv[1]).read()
        mine = picture(text)
        with multiprocessing.get_context("fork").Pool(2) as pool:
            theirs = [result.get(timeout=60) for result in [pool.apply_async(picture, (text,)) for _ in range(4)]]
        assert all(picture == mine for picture in theirs)
        sys.stdout.buffer.write(mine)
    """
    assert in_python(script, tiny) == own


@pytest.mark.skipif(not hasattr(os, "fork"), reason="fork is POSIX's")
def test_fork_amid_work_is_refused(tiny: dp.Camera) -> None:
    """A lock that a thread of the parent holds would never be released in the child."""
    script = """
        import os, sys, threading, time, warnings
        import dioptric as dp
        warnings.simplefilter("ignore")
        camera = dp.Camera.from_ron(open(sys.argv[1]).read())
        camera.render()
        started = threading.Event()
        thread = threading.Thread(target=lambda: camera.with_(
            pixels=(480, 320), pixel_um=66, wavelengths_nm=list(range(400, 701, 10))
        ).render(progress=lambda *told: started.set()))
        thread.start()
        started.wait(60)
        child = os.fork()
        if child == 0:
            try:
                camera.with_(seed=2).render()
            except RuntimeError as error:
                os._exit(3 if "start processes with the method 'spawn'" in str(error) else 4)
            os._exit(5)
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)
        os._exit(0)
    """
    assert in_python(script, tiny).split() == [b"3"]


def in_python(script: str, camera: dp.Camera) -> bytes:
    """Runs a script in a process of its own, with the camera file as its argument."""
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        file = os.path.join(folder, "camera.ron")
        camera.write(file)
        command = [sys.executable, "-c", textwrap.dedent(script), file]
        return subprocess.run(command, check=True, capture_output=True, timeout=120).stdout


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="Linux tells what is resident")
def test_memory_stays_flat(tiny: dp.Camera) -> None:
    def resident_mb() -> float:
        gc.collect()
        with open("/proc/self/statm") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6

    camera = fresh(tiny)

    def render(first: int, n: int) -> None:
        for i in range(first, first + n):
            shot = camera.with_(focus_mm=700 + i, seed=i).render(quality="preview")
            assert shot.rgb.any() and shot.irradiance.any()

    render(0, 25)
    before = resident_mb()
    render(25, 100)
    # A render makes the model of a lens's image of some MB beside its arrays; the allocator keeps some.
    assert resident_mb() - before < 8
