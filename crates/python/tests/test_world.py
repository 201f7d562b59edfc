"""Worlds made and changed from a program; among them four of iset3d's tutorials, in at most 15 lines each."""

from __future__ import annotations

import copy
import inspect
import pickle
from pathlib import Path

import dioptric as dp
import numpy as np
import pytest

ROOM = Path(__file__).parents[3] / "examples" / "worlds" / "room.pbrt"


@pytest.fixture(scope="module")
def cam() -> dp.Camera:
    """A camera of few pixels and bands for worlds."""
    camera = dp.Camera.demo().with_(pixels=(45, 30), pixel_um=800, wavelengths_nm=[450, 550, 650])
    return camera


def intro_chess(cam: dp.Camera) -> list[dp.Shot]:
    """iset3d's t_piIntro_chess: a scene is read, looked at from elsewhere, rendered through a lens, its depths taken."""
    world = dp.World(ROOM)
    world.set_camera(eye=(0, 1.4, -0.5), look_at=(0, 0.5, 2), fov_deg=60)
    near = cam.with_(scene=world.scene(samples=8, size=(45, 30)), focus_mm=2500).render()
    world.set_camera(eye=(-1.5, 1.6, -1), look_at=(0.3, 0.5, 2), fov_deg=45)
    aside = cam.with_(scene=world.scene(samples=8, size=(45, 30)), lens="dgauss-50mm", f_number=4).render()
    assert near.depth_m.shape == (30, 45)
    return [near, aside]


def light_type(cam: dp.Camera) -> dict[str, dp.Shot]:
    """iset3d's t_piLightType: the same scene under one kind of light after another."""
    shots = {}
    for kind in ("area", "point", "spot", "distant", "sky"):
        world = dp.World(ROOM)
        [world.remove(name) for name in ("plaster*", *(light["name"] for light in world.lights))]
        world.set_camera(eye=(0, 1, -0.8), look_at=(0.8, 0.5, 2.5))
        match kind:
            case "area": world.add_area_light(kind, (0, 2.9, 1), (0, 0, 1), (1, 1), lumens=2000, spectrum="3200K")
            case "point": world.add_point_light(kind, (0, 2.5, 1), lumens=2000)
            case "spot": world.add_spot(kind, (0, 2.9, 1), (0, 0, 2), cone_deg=60, soft=0.2, candela=900)
            case "distant": world.add_distant_light(kind, (0, 1, -1), lux=500, spectrum="D50")
            case "sky": world.add_sky(kind, "even:1", mean_cd_m2=300)
        shots[kind] = cam.with_(scene=world.scene(samples=8, size=(45, 30))).render()
    return shots


def camera_position(cam: dp.Camera) -> list[dp.Shot]:
    """iset3d's t_cameraPosition: the camera goes aside, up and nearer, and looks at the same thing."""
    world, shots = dp.World(ROOM), []
    (low, high) = world.bounds_m("green")
    middle = np.add(low, high) / 2
    for step in ((0, 0.5, -2), (0.6, 0.5, -2), (0, 1.2, -2), (0, 0.5, -1.2)):
        world.set_camera(eye=middle + step, look_at=middle, fov_deg=50)
        shots.append(cam.with_(scene=world.scene(samples=8, size=(45, 30))).render())
    return shots


def intro_material(cam: dp.Camera) -> list[dp.Shot]:
    """iset3d's t_piIntro_material: what materials there are, and one thing of others."""
    world, shots = dp.World(ROOM), []
    world.set_camera(eye=(0.4, 1, -0.8), look_at=(1.2, 0.6, 2.2))
    assert {"floor", "green"} <= set(world.materials)
    for material, words in (("green", {}), ("glass", {"made_of": "N-BK7"}), ("mirror", {}), ("metal", {"made_of": "gold"})):
        world.set_material("green", material, **words)
        shots.append(cam.with_(scene=world.scene(samples=8, size=(45, 30))).render())
    return shots


@pytest.mark.parametrize("tutorial", [intro_chess, light_type, camera_position, intro_material])
def test_tutorials_of_iset3d(tutorial: object, cam: dp.Camera) -> None:
    lines = [line for line in inspect.getsource(tutorial).splitlines() if line.strip()]  # type: ignore[arg-type]
    # Without the line that names the function and the sentence about it.
    assert len(lines) - 2 <= 15
    shots = tutorial(cam)  # type: ignore[operator]
    pictures = [shot.rgb for shot in (shots.values() if isinstance(shots, dict) else shots)]
    for first, second in zip(pictures, pictures[1:]):
        assert first.std() > 10 and np.abs(first.astype(float) - second).mean() > 4


def test_moved_things_are_where_they_were_moved(cam: dp.Camera) -> None:
    world = dp.World()
    world.add_sphere("ball", 0.5, at=(0, 0, -4))
    world.add_distant_light("sun", (0, 0, 1), lux=1000)
    world.set_camera(eye=(0, 0, 0), look_at=(0, 0, -1), fov_deg=30, size=(48, 32))

    def middle_m() -> float:
        return float(cam.with_(scene=world.scene(samples=8), pixels=(48, 32)).render().depth_m[16, 24])

    def level() -> float:
        return float(cam.with_(scene=world.scene(samples=8), pixels=(48, 32)).render().irradiance.mean())

    labels, names = cam.with_(scene=world.scene(samples=8), pixels=(48, 32)).render().objects()
    assert names[labels[16, 24] - 1] == "ball" and labels[0, 0] == 0
    assert middle_m() == pytest.approx(3.5, rel=1e-3)
    world.move("ball", to=(0, 0, -6))
    assert middle_m() == pytest.approx(5.5, rel=1e-3)
    assert world.bounds_m("ball") == ((-0.5, -0.5, -6.5), (0.5, 0.5, -5.5))
    before = level()
    world.brighten("sun", 2)
    assert level() == pytest.approx(2 * before, rel=1e-5)
    world.copy("ball", "ball")
    world.move("ball.2", by=(0, 0, 1))
    world.scale("ball.2", (1, 1, 0.5))
    assert world.bounds_m("ball.2") == ((-0.5, -0.5, -5.25), (0.5, 0.5, -4.75))


def test_levels_are_what_is_asked_for(cam: dp.Camera) -> None:
    scene = dp.World(ROOM).scene(samples=64, size=(45, 30), fov_deg=34, mean_luminance_cd_m2=120)
    shot = cam.with_(scene=scene, wavelengths_nm=list(range(400, 701, 20))).render()
    assert shot.report()["scene"]["mean_luminance_cd_m2"] == pytest.approx(120, rel=0.05)
    lit = cam.with_(scene=dp.World(ROOM).scene(samples=8, size=(45, 30), fov_deg=34), mean_lux=7).render()
    assert lit.report()["irradiance"]["mean_lux"] == pytest.approx(7, rel=1e-6)


def test_worlds_are_kept_written_and_sent(tmp_path: Path, cam: dp.Camera) -> None:
    world = dp.World(ROOM)
    world.add_mesh("sheet", [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], at=(0, 0, 1), color=(0.1, 0.5, 0.1))
    world.add_file("again", ROOM, at=(20, 0, 0))
    assert {"sheet", "again", "red", "red.2"} <= set(world.names)
    parents = {row["name"]: row["parent"] for row in world.objects}
    assert parents["red.2"] == "again"
    assert world.find("re?*") == ["red", "red.2"] and "red.2" in world.find("again")
    sent = pickle.loads(pickle.dumps(world))
    apart = copy.deepcopy(world)
    world.remove("again")
    assert sent.names == apart.names and "red.2" in sent.names and "red.2" not in world.names
    kept = cam.with_(scene=world.scene(samples=8))
    (tmp_path / "kept.ron").write_text(kept.to_ron())
    assert dp.Camera.read(tmp_path / "kept.ron").to_ron() == kept.to_ron()
    pickle.loads(pickle.dumps(kept.scene))
    assert world.write(tmp_path / "room.pbrt") == []
    assert sorted(dp.World(tmp_path / "room.pbrt").names) == sorted(world.names)


def test_wrong_words_are_told() -> None:
    world = dp.World(ROOM)
    for act, expected in [
        (lambda: world.move("gren", by=(1, 0, 0)), "no object is called 'gren': near it are 'green'"),
        (lambda: world.move("green"), "expected how far, 'by', or where, 'to'"),
        (lambda: world.turn("green", "w", 3), "axis: 'w', expected 'x', 'y', 'z' or a direction"),
        (lambda: world.scale("green", 0), "expected a finite transform"),
        (lambda: world.set_material("green", "wood"), "no material is called 'wood'"),
        (lambda: world.set_material("green", "matte", roughness=1), "'matte' has no roughness"),
        (lambda: world.set_material("green", "metal", made_of="brass"), "expected silver, gold, copper or aluminium"),
        (lambda: world.add_point_light("a", (0, 0, 0)), "expected one of watts, lumens, candela, per_nm"),
        (lambda: world.add_sphere("a", -1), "the radius of a shape is -1"),
        (lambda: world.set_camera(eye=(0, 0, 0), look_at=(0, 1, 0)), "expected two places, and an up across the view"),
        (lambda: world.brighten("green", 2), "expected one that gives light"),
        (lambda: dp.World("none.xyz"), "expected a .pbrt"),
    ]:
        n = len(world.names)
        with pytest.raises(ValueError) as caught:  # noqa: PT011
            act()
        assert expected in str(caught.value), str(caught.value)
        assert len(world.names) == n
    with pytest.raises(TypeError, match="no argument 'colour'"):
        world.add_sphere("a", 1, colour=0.5)
