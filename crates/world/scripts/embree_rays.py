"""Rays a second of Embree through the mesh of `cargo bench -p dioptric-world`, one thread: coherent and incoherent, as there.

    pip install numpy embreex
    python embree_rays.py
"""

import time

import embreex
import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh

N, RAYS, ROUNDS = 707, 65_536, 15


def bumpy_sphere(n):
    polar, azimuth = np.meshgrid(np.pi * np.arange(n + 1) / n, 2 * np.pi * np.arange(n + 1) / n, indexing="ij")
    radius = 1 + 0.05 * np.sin(31 * azimuth) * np.cos(23 * polar)
    flat = np.sin(polar)
    points = radius[..., None] * np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.cos(polar)], -1)
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    triangles = np.concatenate([np.stack([a, a + n + 1, a + n + 2], -1), np.stack([a, a + n + 2, a + 1], -1)])
    return points.reshape(-1, 3).astype(np.float32), triangles.astype(np.int32)


def rays(is_coherent):
    i, side = np.arange(RAYS), np.sqrt(RAYS)
    if is_coherent:
        x, y = i % side / side - 0.5, i / side / side - 0.5
        origins = np.tile([0.0, 0.0, -3.0], (RAYS, 1))
        directions = np.stack([x, y, np.full(RAYS, 1.5)], -1)
    else:
        random = np.random.default_rng(1)
        origins = 1.5 * random.uniform(-1, 1, (RAYS, 3))
        directions = 0.9 * random.uniform(-1, 1, (RAYS, 3)) - origins
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return origins.astype(np.float32), directions.astype(np.float32)


def main():
    began = time.perf_counter(), time.process_time()
    scene = rtcore_scene.EmbreeScene()
    vertices, triangles = bumpy_sphere(N)
    TriangleMesh(scene, vertices, triangles)
    for name, is_coherent in [("coherent", True), ("incoherent", False)]:
        origins, directions = rays(is_coherent)
        for query in ["INTERSECT", "OCCLUDED"]:
            hits = scene.run(origins, directions, query=query)
            if query == "INTERSECT" and is_coherent and name == "coherent":
                print(f"building, with the first rays: {time.perf_counter() - began[0]:.2f} s, {time.process_time() - began[1]:.2f} of processors")
            times = []
            for _ in range(ROUNDS):
                start = time.process_time()
                scene.run(origins, directions, query=query)
                times.append(time.process_time() - start)
            n_hit = int((np.asarray(hits) >= 0).sum()) if query == "INTERSECT" else 0
            print(f"{name}, {query}: {RAYS / min(times) / 1e6:.2f} M rays a second ({n_hit} hit)")


if __name__ == "__main__":
    print("embreex", getattr(embreex, "__version__", "?"))
    main()
