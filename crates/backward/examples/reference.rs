//! Renders a picture of a scene that is described by a `scene.json`, for comparison with other renderers:
//! `cargo run --release --example reference -- FOLDER CAMERA SAMPLES OUT.exr [SEED]`.
//!
//! A scene has meshes and spheres in meters before a camera that looks along +z, Lambertian or black, glowing or not, and
//! cameras of the kinds `pinhole`, `thinlens` and `lens`.
#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a program for developers ends at the first thing amiss")]

use std::{fs, path::Path, time::Instant};

use dioptric_backward::{
    BandSampling, Bands, Camera, LensCamera, LensCameraSettings, LensOrigin, LightPaths, Pinhole, PixelGrid, Placement,
    RenderSettings, Renderer, ThinLens, write_rendering_exr,
};
use dioptric_optics::{Glass, Interface, Lens, Surface, glam::DVec2};
use dioptric_spectrum::{Cancel, Spectrum, WavelengthGrid};
use dioptric_world::{
    Beyond, Emission, Light, Material, MaterialId, Shape, SpectralCurve, Texture, TriangleMesh, World, WorldBuilder,
    glam::{DAffine3, DVec3},
};
use serde_json::Value;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, camera_name, n_samples, out, rest @ ..] = &arguments[..] else {
        panic!("expected FOLDER CAMERA SAMPLES OUT.exr [SEED]");
    };
    let n_samples: u32 = n_samples.parse().unwrap();
    let text = fs::read_to_string(Path::new(folder).join("scene.json")).unwrap();
    let scene: Value = serde_json::from_str(&text).unwrap();
    let began = Instant::now();
    let world = world_of(&scene);
    let camera = camera_of(&scene, camera_name);
    println!("world and camera: {:.2} s", began.elapsed().as_secs_f64());
    let paths = match scene["max_bounces"].as_i64().unwrap() {
        -1 => LightPaths::Full,
        most => LightPaths::UpTo(most as u32),
    };
    let samples_per_pass = (n_samples / 16).clamp(1, 64);
    let seed = rest.first().map_or(1, |seed| seed.parse().unwrap());
    let settings = RenderSettings { bands: bands(), paths, samples_per_pass, seed, clamp: None };
    let mut renderer = Renderer::new(&world, &camera, settings).unwrap();
    while renderer.n_passes() * samples_per_pass < n_samples {
        renderer.pass(&Cancel::new(), &|_| {}).unwrap();
    }
    write_rendering_exr(Path::new(out), &renderer.rendering(), None).unwrap();
    println!("{camera_name}: {} samples, {:.2} s", n_samples, began.elapsed().as_secs_f64());
}

fn bands() -> Bands {
    Bands { grid: WavelengthGrid::uniform(420.0, 700.0, 40.0).unwrap(), sampling: BandSampling::Mean }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

fn point(value: &Value) -> DVec3 {
    DVec3::from_slice(&numbers(value))
}

fn curve(scene: &Value, name: &Value, beyond: Beyond) -> SpectralCurve {
    let spectrum = &scene["spectra"][name.as_str().unwrap()];
    SpectralCurve::new(
        &Spectrum::new(numbers(&spectrum["wavelengths_nm"]), numbers(&spectrum["values"])).unwrap(),
        beyond,
    )
}

fn world_of(scene: &Value) -> World {
    let mut builder = WorldBuilder::new();
    let black = builder.add_texture(Texture::Curve(SpectralCurve::constant(0.0)));
    let black = builder.add_material("black", Material::Matte { reflectance: black });
    let materials: Vec<(String, MaterialId)> = scene["materials"]
        .as_object()
        .unwrap()
        .iter()
        .map(|(name, material)| {
            let texture = builder.add_texture(Texture::Curve(curve(scene, &material["reflectance"], Beyond::Held)));
            (name.clone(), builder.add_material(name, Material::Matte { reflectance: texture }))
        })
        .collect();
    for object in scene["objects"].as_array().unwrap() {
        let named = |name: &str| materials.iter().find(|(known, _)| known == name).unwrap().1;
        let material = object["material"].as_str().map_or(black, named);
        let emission = object["emission"].as_object().map(|emission| Emission {
            radiance: curve(scene, &emission["radiance"], Beyond::Held)
                .scaled(emission["scale"].as_f64().unwrap() as f32),
            is_two_sided: emission["sides"] == "both",
        });
        let (shape, place) = match object["type"].as_str().unwrap() {
            "sphere" => {
                let radius_m = object["radius_m"].as_f64().unwrap();
                (Shape::Sphere { radius_m }, DAffine3::from_translation(point(&object["center_m"])))
            }
            "mesh" => {
                let corner = |triangle: &Value| [0, 1, 2].map(|i| triangle[i].as_u64().unwrap() as u32);
                let mesh = TriangleMesh {
                    positions: object["vertices_m"].as_array().unwrap().iter().map(|p| point(p).as_vec3()).collect(),
                    triangles: object["triangles"].as_array().unwrap().iter().map(corner).collect(),
                    ..TriangleMesh::default()
                };
                (Shape::Mesh(mesh), DAffine3::IDENTITY)
            }
            other => panic!("an object of the kind '{other}', expected sphere or mesh"),
        };
        builder.add_shape(shape, place, material, emission);
    }
    if scene["environment"].is_object() {
        let environment = &scene["environment"];
        let scale = environment["scale"].as_f64().unwrap_or(1.0) as f32;
        builder.add_light(Light::Sky { radiance: curve(scene, &environment["radiance"], Beyond::Held).scaled(scale) });
    }
    builder.build().unwrap()
}

fn camera_of(scene: &Value, name: &str) -> Camera {
    let camera = &scene["cameras"][name];
    let number = |key: &str| camera[key].as_f64().unwrap();
    let size = |key: &str| camera[key].as_u64().unwrap() as usize;
    let pixels = PixelGrid::new(size("width"), size("height"));
    let view = || Pinhole {
        placement: Placement::IDENTITY,
        pixels,
        half_tangents: DVec2::splat(number("tan_half_fov")),
        layer: 0,
    };
    match camera["type"].as_str().unwrap() {
        "pinhole" => Camera::Pinhole(view()),
        "thinlens" => Camera::ThinLens(ThinLens {
            view: view(),
            radius_m: number("lens_radius_m"),
            focus_distance_m: number("focus_distance_m"),
        }),
        "lens" => {
            let [x0, x1, y0, y1] = [0, 1, 2, 3].map(|i| camera["crop"][i].as_u64().unwrap() as usize);
            let settings = LensCameraSettings {
                film_distance_mm: number("film_to_rear_vertex_mm"),
                film_size_mm: DVec2::new(number("film_width_mm"), number("film_height_mm")),
                pixels: pixels.cropped((x0, y0), (x1 - x0, y1 - y0)).unwrap(),
                placement: Placement::IDENTITY,
                origin: LensOrigin::Film,
                diffraction: None,
                micro_array: None,
            };
            let lens = lens_of(&scene["lenses"][camera["lens"].as_str().unwrap()], camera);
            Camera::Lens(Box::new(LensCamera::new(&lens, &bands(), settings).unwrap()))
        }
        other => panic!("a camera of the kind '{other}', expected pinhole, thinlens or lens"),
    }
}

fn lens_of(lens: &Value, camera: &Value) -> Lens {
    let is_dispersive = camera["dispersion"].as_bool().unwrap();
    let mut stop = 0;
    let interface = |(i, row): (usize, &Value)| {
        let number = |key: &str| row[key].as_f64().unwrap();
        let is_stop = number("radius_mm") == 0.0;
        let index = number("n_d").max(1.0);
        let medium_after = match is_dispersive && index > 1.0 {
            true => Glass::Cauchy { a: number("cauchy_A"), b_um2: number("cauchy_B_um2") },
            false => Glass::Constant { index },
        };
        let surface = match is_stop {
            true => Surface::plane(0.5 * camera["stop_diameter_mm"].as_f64().unwrap()),
            false => Surface::sphere(number("radius_mm"), 0.5 * number("diameter_mm")),
        };
        if is_stop {
            stop = i;
        }
        Interface { surface, medium_after, thickness_after_mm: number("thickness_mm") }
    };
    let interfaces: Vec<Interface> = lens["surfaces"].as_array().unwrap().iter().enumerate().map(interface).collect();
    let lens = Lens::new(lens["name"].as_str().unwrap(), "scene.json", interfaces, stop).unwrap();
    lens.with_object_medium(Glass::Constant { index: 1.0 }).unwrap()
}
