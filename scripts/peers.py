"""Traces 100,000 rays through the 50 mm double Gauss with dioptric, batoid and Optiland, where they are installed.

The rays are those of `cargo bench -p dioptric-optics -- double_gauss`: from a point 2 m away, tan 0.1 off the axis, over
a disc 1.1 times the entrance pupil. Prints ray-surfaces per core-second, the film counted as a surface.

    pip install . batoid optiland
    OMP_NUM_THREADS=1 python scripts/peers.py

dioptric's time is that of the whole call from Python: it takes rows of points and directions and makes new arrays.
"""

import time

import numpy as np

RADIUS_MM = [29.475, 84.83, 19.275, 40.77, 12.75, np.inf, -14.495, 40.77, -20.385, 437.065, -39.73]
THICKNESS_MM = [3.76, 0.12, 4.025, 3.275, 5.705, 4.5, 1.18, 6.065, 0.19, 3.22, 36.41]
INDEX = [1.67, 1, 1.67, 1.699, 1, 1, 1.603, 1.658, 1, 1.717, 1]
DIAMETER_MM = [25.2, 25.2, 23, 23, 18, 17.1, 17, 20, 20, 20, 20]
PUPIL_Z_MM, PUPIL_RADIUS_MM = 19.9558, 12.4149
N_RAYS, N_SURFACES, REPEATS = 100_000, 12, 15


def rays_mm():
    """Returns starts on the first vertex plane and unit directions, each 3 x N."""
    i = np.arange(N_RAYS)
    rho, angle = 1.1 * PUPIL_RADIUS_MM * np.sqrt((i + 0.5) / N_RAYS), 2.399963229728653 * i
    target = np.array([rho * np.cos(angle), rho * np.sin(angle), np.full(N_RAYS, PUPIL_Z_MM)])
    point = np.array([[200.0], [0.0], [PUPIL_Z_MM - 2000.0]])
    direction = target - point
    direction /= np.linalg.norm(direction, axis=0)
    return target - direction * (PUPIL_Z_MM / direction[2]), direction


def report(name, run):
    """Runs a few times and prints the fastest; `run` returns how many rays reach the film and where they do, in mm."""
    seconds = []
    for _ in range(REPEATS):
        begin = time.process_time()
        result = run()
        seconds.append(time.process_time() - begin)
    n_arrived, x_mm = result()
    rate = N_RAYS * N_SURFACES / min(seconds) / 1e6
    print(f"{name}: {rate:.2f} M ray-surfaces per core-second; {n_arrived} rays arrive, at x = {x_mm:.4f} mm on average")


def batoid_run():
    import batoid

    items, z_mm, before = [], 0.0, 1.0
    for number, row in enumerate(zip(RADIUS_MM, THICKNESS_MM, INDEX, DIAMETER_MM)):
        radius_mm, thickness_mm, after, diameter_mm = row
        surface = batoid.Plane() if np.isinf(radius_mm) else batoid.Sphere(1e-3 * radius_mm)
        kind = batoid.optic.Baffle if before == after else batoid.RefractiveInterface
        rim = batoid.ObscNegation(batoid.ObscCircle(0.5e-3 * diameter_mm))
        media = {"inMedium": batoid.ConstMedium(before), "outMedium": batoid.ConstMedium(after)}
        place = batoid.CoordSys().shiftGlobal([0, 0, 1e-3 * z_mm])
        items.append(kind(surface, name=str(number), obscuration=rim, coordSys=place, **media))
        z_mm, before = z_mm + thickness_mm, after
    film = batoid.CoordSys().shiftGlobal([0, 0, 1e-3 * z_mm])
    items.append(batoid.Detector(batoid.Plane(), name="film", coordSys=film))
    lens = batoid.CompoundOptic(items, name="double Gauss")
    starts, directions = rays_mm()
    rays = batoid.RayVector(*(1e-3 * starts), *directions, t=0.0, wavelength=550e-9)

    def run():
        traced = lens.trace(rays.copy())
        good = lambda: ~(traced.vignetted | traced.failed)
        return lambda: (good().sum(), 1e3 * traced.x[good()].mean())

    return run


def optiland_run():
    from optiland.materials import IdealMaterial
    from optiland.optic import Optic
    from optiland.physical_apertures import RadialAperture
    from optiland.rays import RealRays

    lens = Optic()
    lens.surfaces.add(index=0, thickness=np.inf)
    for number, row in enumerate(zip(RADIUS_MM, THICKNESS_MM, INDEX, DIAMETER_MM)):
        radius_mm, thickness_mm, index, diameter_mm = row
        lens.surfaces.add(
            index=number + 1,
            radius=radius_mm,
            thickness=thickness_mm,
            material=IdealMaterial(n=index),
            is_stop=number == 5,
            aperture=RadialAperture(r_max=0.5 * diameter_mm),
        )
    lens.surfaces.add(index=len(RADIUS_MM) + 1)
    starts, directions = rays_mm()

    def run():
        ones = np.ones(N_RAYS)
        rays = RealRays(*starts, *directions, ones, 0.55 * ones)
        lens.surfaces.trace(rays, skip=1)
        good = lambda: rays.i > 0
        return lambda: (good().sum(), rays.x[good()].mean())

    return run


def dioptric_run():
    import dioptric

    def row(number, radius_mm, thickness_mm, index, diameter_mm):
        thickness_mm = 0 if number == len(RADIUS_MM) - 1 else thickness_mm
        radius = "" if np.isinf(radius_mm) else f"radius_mm: {radius_mm}, "
        medium = f"Constant(index: {index})"
        stop = "stop: true, " if number == 5 else ""
        return f"({stop}{radius}semi_aperture_mm: {diameter_mm / 2}, medium: {medium}, thickness_mm: {thickness_mm})"

    rows = map(row, range(len(RADIUS_MM)), RADIUS_MM, THICKNESS_MM, INDEX, DIAMETER_MM)
    lens = dioptric.Lens.parse(f'(name: "double Gauss", source: "peers.py", surfaces: [{", ".join(rows)}])')
    starts, directions = (np.ascontiguousarray(rows.T) for rows in rays_mm())

    def run():
        rays = lens.trace(starts, directions, 550, film_mm=THICKNESS_MM[-1])
        return lambda: (rays.passed.sum(), rays.x_mm[rays.passed].mean())

    return run


for peer, prepare in [("dioptric", dioptric_run), ("batoid", batoid_run), ("Optiland", optiland_run)]:
    try:
        job = prepare()
    except ImportError:
        print(f"{peer} is not installed: skipped")
        continue
    report(peer, job)
