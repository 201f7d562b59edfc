//! Pictures of all directions, and what a camera in their middle sees of them in perspective.

use std::{
    f64::consts::{PI, TAU},
    path::Path,
};

use dioptric_spectrum::SpectralImage;
use ndarray::Array2;
use rayon::prelude::*;

use super::{
    contents::{Contents, Image},
    picture::linear_srgb,
    read_options::ReadOptions,
    reading::{DepthKind, Frame, Panorama},
    stated::{name_of, note_of},
    unusable::{check_made, unreadable},
};
use crate::{SceneError, View};

/// The most columns that a perspective view may have: those of a small panorama, or so many times those of another.
const MOST_COLUMNS: usize = 4096;
const MOST_FINER: usize = 4;

/// Puts what a camera sees in place of a picture of all directions, and of its distances: as many columns as rows, as fine on the axis as
/// the picture is, or as the film needs.
///
/// # Errors
/// When no field of view is given, or one beside camera data; when the picture has not the shape of its kind, or its depth is not radial.
pub(super) fn look(
    path: &Path,
    contents: &mut Contents,
    kind: Panorama,
    options: &ReadOptions,
) -> Result<(), SceneError> {
    let fov_deg = options.horizontal_fov_deg.ok_or_else(|| {
        unreadable(path, "of a panorama a part is seen: expected a field of view (--fov-deg), below 180°")
    })?;
    if fov_deg >= 180.0 {
        let reason = format!(
            "a scene is a picture on a plane, which a panorama of {fov_deg}° has none of: expected a field of view below 180°, or \
             `dioptric render` with the panorama as its sky (--sky)"
        );
        return Err(unreadable(path, reason));
    }
    if options.reading.view.is_some() || contents.hidden.is_some() {
        return Err(unreadable(path, "a panorama has neither camera data nor a hidden layer: expected it without"));
    }
    let (rows, columns) = contents.size();
    let stated = contents.panorama;
    let sphere = Sphere::new(path, kind, (rows, columns), stated)?;
    if sphere.layout == Layout::Column {
        let order = "right, left, up, down, front, back: OpenEXR's order is that of files that state it (envmap)";
        contents.notes.push(format!("{}: its six faces below each other are taken for {order}", name_of(path)));
    }
    let is_other = stated.is_some_and(|own| std::mem::discriminant(&own) != std::mem::discriminant(&kind));
    let unused = [is_other.then_some("envmap"), contents.view.take().map(|_| "camera data")];
    let unused: Vec<String> = unused.into_iter().flatten().map(str::to_owned).collect();
    contents.notes.extend(note_of(path, "statement", &unused).map(|note| note + ", as of a panorama that is told"));
    // A film that needs less gets means over blocks; depths stay as they are.
    let coarser = options.finest_tangent.map_or(1, |finest| (finest / sphere.step()) as usize);
    let divides = |bin: &usize| {
        sphere.may_be_binned() && rows.is_multiple_of(*bin) && columns.is_multiple_of(*bin) && contents.depth.is_none()
    };
    let bin = (1..=coarser.clamp(1, 64)).rev().find(divides).unwrap_or(1);
    let sphere = Sphere::new(path, kind, (rows / bin, columns / bin), stated)?;
    let half = (0.5 * fov_deg.to_radians()).tan();
    let wanted = (2.0 * half / sphere.step()).ceil();
    let most = MOST_COLUMNS.max(MOST_FINER * columns);
    let side = (wanted as usize).clamp(1, most);
    if wanted > most as f64 {
        contents.notes.push(format!(
            "{}: at {fov_deg}° a plane of {wanted} columns would be as fine on the axis as the panorama: it has {side}",
            name_of(path)
        ));
    }
    let view = View::from_horizontal_fov_deg(fov_deg, side, side)?;
    let n_planes = match &contents.image {
        Image::Spectral(image) => image.grid().len(),
        Image::Linear { .. } | Image::Codes(..) => 3,
    };
    check_made(path, (4 * n_planes as u64 + 8).saturating_mul((side * side) as u64))?;
    let places: Vec<(f32, f32)> = (0..side * side)
        .into_par_iter()
        .map(|i| sphere.place_of(view.tan_at((i / side) as f64, (i % side) as f64)))
        .collect();
    let seen = |plane: &Array2<f32>| {
        let binned = if bin == 1 { None } else { Some(means(plane, bin)) };
        let plane = binned.as_ref().unwrap_or(plane);
        let samples = places.par_iter().map(|place| sphere.mixed(plane, *place)).collect();
        Array2::from_shape_vec((side, side), samples).expect("one sample a place")
    };
    contents.image =
        match std::mem::replace(&mut contents.image, Image::Linear { planes: Default::default(), white_cd_m2: None }) {
            Image::Spectral(image) => {
                let planes = image.planes().iter().map(seen).collect();
                Image::Spectral(SpectralImage::new(image.quantity(), image.grid().clone(), planes)?)
            }
            Image::Linear { planes, white_cd_m2 } => Image::Linear { planes: planes.each_ref().map(seen), white_cd_m2 },
            Image::Codes(picture, colors) => {
                let planes = linear_srgb(picture, colors.as_ref());
                Image::Linear { planes: planes.each_ref().map(seen), white_cd_m2: None }
            }
        };
    if let Some(depth) = &mut contents.depth {
        if options.reading.depth_kind.is_none() && depth.kind == DepthKind::Axial {
            depth.kind = DepthKind::Radial;
        }
        if depth.kind != DepthKind::Radial {
            return Err(unreadable(
                &depth.file,
                "the depth of a panorama is the distance from its middle: expected radial",
            ));
        }
        let samples = places.iter().map(|place| sphere.nearest(&depth.values, *place)).collect();
        depth.values = Array2::from_shape_vec((side, side), samples).expect("one sample a place");
    }
    let [yaw_deg, pitch_deg] = kind.looks_deg();
    contents.what += &format!(
        ", {side} × {side} samples seen {yaw_deg}° right and {pitch_deg}° up of a panorama of {columns} × {rows}"
    );
    contents.frame = Some(Frame::whole(side, side));
    Ok(())
}

/// Means over blocks that share out a plane.
fn means(plane: &Array2<f32>, bin: usize) -> Array2<f32> {
    let (rows, columns) = plane.dim();
    Array2::from_shape_fn((rows / bin, columns / bin), |(row, column)| {
        let block = ndarray::s![row * bin..(row + 1) * bin, column * bin..(column + 1) * bin];
        plane.slice(block).sum() / (bin * bin) as f32
    })
}

/// How the faces of a cube lie in a picture.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Layout {
    /// As a cross, 4 × 3.
    Cross,
    /// Side by side: right, left, up, down, front, back.
    Strip,
    /// Below each other in the same order.
    Column,
    /// Below each other as `OpenEXR` has them (`ImfEnvmap.h`): +X, −X, +Y, −Y, +Z, −Z, the outermost samples on the edges of the cube; +Z lies
    /// straight ahead and +X to the left.
    OpenExr,
}

/// Where in a picture of all directions a direction lies.
struct Sphere {
    kind: Panorama,
    rows: usize,
    columns: usize,
    /// Samples along the side of a face of a cube.
    side: usize,
    layout: Layout,
    /// Sines and cosines of where the camera looks: to the right, and up.
    yaw: (f64, f64),
    pitch: (f64, f64),
}

/// Places of faces in a cross and side by side, columns and rows of faces: right, left, up, down, front, back.
const IN_CROSS: [(usize, usize); 6] = [(2, 1), (0, 1), (1, 0), (1, 2), (1, 1), (3, 1)];

impl Sphere {
    /// `stated` is what the file says of itself.
    fn new(
        path: &Path,
        kind: Panorama,
        (rows, columns): (usize, usize),
        stated: Option<Panorama>,
    ) -> Result<Self, SceneError> {
        let is_of_exr = matches!(stated, Some(Panorama::Cube { .. }));
        let layout = match (3 * columns == 4 * rows, columns == 6 * rows, rows == 6 * columns) {
            (true, ..) if rows >= 3 => Some(Layout::Cross),
            (_, true, _) => Some(Layout::Strip),
            (.., true) if !is_of_exr => Some(Layout::Column),
            (.., true) if columns >= 2 => Some(Layout::OpenExr),
            _ => None,
        };
        let wrong =
            |expected: &str| Err(unreadable(path, format!("it is {columns} × {rows} samples, expected {expected}")));
        match kind {
            Panorama::Equirectangular { .. } if columns.abs_diff(2 * rows) > 1 || rows < 2 => {
                return wrong("a panorama twice as wide as high");
            }
            Panorama::Cube { .. } if layout.is_none() => {
                return wrong(
                    "the six faces of a cube as a cross, 4 × 3, side by side, 6 × 1, or below each other, 1 × 6",
                );
            }
            _ => {}
        }
        let [yaw, pitch] = kind.looks_deg().map(|deg| deg.to_radians().sin_cos());
        let layout = layout.unwrap_or(Layout::Strip);
        let side = match layout {
            Layout::Cross => columns / 4,
            Layout::Strip => rows,
            Layout::Column | Layout::OpenExr => columns,
        };
        Ok(Self { kind, rows, columns, side, layout, yaw, pitch })
    }

    /// Whether means over blocks of its samples lie as its samples do.
    fn may_be_binned(&self) -> bool {
        matches!(self.kind, Panorama::Equirectangular { .. }) || self.layout != Layout::OpenExr
    }

    /// The tangent between two samples in its middle.
    fn step(&self) -> f64 {
        match self.kind {
            Panorama::Equirectangular { .. } => TAU / self.columns as f64,
            Panorama::Cube { .. } => 2.0 / self.side as f64,
        }
    }

    /// Returns the row and column of what is seen at these tangents to the right and upwards.
    fn place_of(&self, (tan_x, tan_y): (f64, f64)) -> (f32, f32) {
        let (sin, cos) = self.pitch;
        let (up, ahead) = (tan_y * cos + sin, cos - tan_y * sin);
        let (sin, cos) = self.yaw;
        let (x, y, z) = (tan_x * cos + ahead * sin, up, ahead * cos - tan_x * sin);
        match self.kind {
            Panorama::Equirectangular { .. } => {
                let (right, height) = (x.atan2(z), y.atan2(x.hypot(z)));
                let column = (right / TAU + 0.5) * self.columns as f64 - 0.5;
                ((((0.5 - height / PI) * self.rows as f64) - 0.5) as f32, column as f32)
            }
            Panorama::Cube { .. } if self.layout == Layout::OpenExr => self.open_exr_place(-x, y, z),
            Panorama::Cube { .. } => {
                let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
                // On each face to its right and downwards, −1 to 1.
                let (face, right, down) = if az >= ax && az >= ay {
                    if z > 0.0 { (4, x / az, -y / az) } else { (5, -x / az, -y / az) }
                } else if ax >= ay {
                    if x > 0.0 { (0, -z / ax, -y / ax) } else { (1, z / ax, -y / ax) }
                } else if y > 0.0 {
                    (2, x / ay, z / ay)
                } else {
                    (3, x / ay, -z / ay)
                };
                let (left, top) = match self.layout {
                    Layout::Cross => IN_CROSS[face],
                    Layout::Column => (0, face),
                    Layout::Strip | Layout::OpenExr => (face, 0),
                };
                // Within the samples of its face: beside it in the picture lies another direction.
                let n = self.side as f64;
                let within = |at: f64| (0.5 * (at + 1.0) * n - 0.5).clamp(0.0, n - 1.0);
                (((top * self.side) as f64 + within(down)) as f32, ((left * self.side) as f64 + within(right)) as f32)
            }
        }
    }

    /// Returns the row and column of a direction in the axes of `OpenEXR`.
    fn open_exr_place(&self, x: f64, y: f64, z: f64) -> (f32, f32) {
        let last = self.side as f64 - 1.0;
        let on = |along: f64, largest: f64| 0.5 * (along / largest + 1.0) * last;
        let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
        let (face, row, column) = if ax >= ay && ax >= az {
            let (p, q) = (on(y, ax), on(z, ax));
            if x > 0.0 { (0, last - p, q) } else { (1, last - p, last - q) }
        } else if ay >= az {
            let (p, q) = (on(x, ay), on(z, ay));
            if y > 0.0 { (2, last - q, p) } else { (3, q, p) }
        } else {
            let (p, q) = (on(x, az), on(y, az));
            if z > 0.0 { (4, last - q, last - p) } else { (5, last - q, p) }
        };
        ((row + (face * self.side) as f64) as f32, column as f32)
    }

    /// Returns a sample beside another, round the world where the picture goes round it.
    fn at(&self, plane: &Array2<f32>, row: i64, column: i64) -> f32 {
        let row = row.clamp(0, self.rows as i64 - 1) as usize;
        let column = match self.kind {
            Panorama::Equirectangular { .. } => column.rem_euclid(self.columns as i64),
            Panorama::Cube { .. } => column.clamp(0, self.columns as i64 - 1),
        };
        plane[(row, column as usize)]
    }

    /// Returns the value at a place, in straight lines between samples.
    fn mixed(&self, plane: &Array2<f32>, (row, column): (f32, f32)) -> f32 {
        let (top, left) = (row.floor(), column.floor());
        let (down, across) = (row - top, column - left);
        let (top, left) = (top as i64, left as i64);
        let line = |row: i64| (1.0 - across) * self.at(plane, row, left) + across * self.at(plane, row, left + 1);
        let upper = line(top);
        // At the side of a face the sample behind counts nothing.
        if down == 0.0 { upper } else { (1.0 - down) * upper + down * line(top + 1) }
    }

    fn nearest(&self, plane: &Array2<f32>, (row, column): (f32, f32)) -> f32 {
        self.at(plane, row.round() as i64, column.round() as i64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FileReading, read_scene};
    use approx::assert_abs_diff_eq;

    /// A smooth function of the direction.
    fn light(direction: [f64; 3]) -> f64 {
        let [x, y, z] = direction;
        let n = (x * x + y * y + z * z).sqrt();
        0.5 + 0.2 * x / n + 0.15 * y / n + 0.1 * z / n
    }

    /// A panorama whose samples are [`light`] in their directions.
    fn panorama(kind: Panorama, columns: usize) -> Array2<f32> {
        let rows = match kind {
            Panorama::Equirectangular { .. } => columns / 2,
            Panorama::Cube { .. } => 3 * columns / 4,
        };
        let n = columns as f64 / 4.0;
        Array2::from_shape_fn((rows, columns), |(row, column)| match kind {
            Panorama::Equirectangular { .. } => {
                let right = ((column as f64 + 0.5) / columns as f64 - 0.5) * TAU;
                let height = (0.5 - (row as f64 + 0.5) / rows as f64) * PI;
                light([right.sin() * height.cos(), height.sin(), right.cos() * height.cos()]) as f32
            }
            Panorama::Cube { .. } => {
                let place = ((column as f64 / n) as usize, (row as f64 / n) as usize);
                let on = |at: usize| 2.0 * ((at as f64 % n) + 0.5) / n - 1.0;
                let (u, v) = (on(column), on(row));
                match IN_CROSS.iter().position(|own| *own == place) {
                    Some(0) => light([1.0, -v, -u]) as f32,
                    Some(1) => light([-1.0, -v, u]) as f32,
                    Some(2) => light([u, 1.0, v]) as f32,
                    Some(3) => light([u, -1.0, -v]) as f32,
                    Some(4) => light([u, -v, 1.0]) as f32,
                    Some(_) => light([-u, -v, -1.0]) as f32,
                    None => f32::NAN,
                }
            }
        })
    }

    /// Whatever the kind and wherever the camera looks, a sample shows what lies in its direction.
    #[test]
    fn cameras_see_what_lies_in_their_directions() {
        for (word, columns) in [("equirectangular", 512), ("cube", 512)] {
            for (yaw_deg, pitch_deg) in [(0.0_f64, 0.0_f64), (100.0, 0.0), (-170.0, 20.0), (30.0, 85.0), (-60.0, -50.0)]
            {
                let kind: Panorama = format!("{word}:{yaw_deg},{pitch_deg}").parse().unwrap();
                let plane = panorama(kind, columns);
                let (rows, columns) = plane.dim();
                let sphere = Sphere::new(Path::new("a"), kind, (rows, columns), None).unwrap();
                let (yaw, pitch) = (yaw_deg.to_radians(), pitch_deg.to_radians());
                for (tan_x, tan_y) in [(0.0, 0.0), (1.5, 0.3), (-2.0, 1.0), (0.2, -3.0), (5.0, 5.0)] {
                    // To the right, up and ahead of the camera in the directions of the panorama.
                    let right = [yaw.cos(), 0.0, -yaw.sin()];
                    let ahead = [yaw.sin() * pitch.cos(), pitch.sin(), yaw.cos() * pitch.cos()];
                    let up = [-yaw.sin() * pitch.sin(), pitch.cos(), -yaw.cos() * pitch.sin()];
                    let direction = [0, 1, 2].map(|i| ahead[i] + tan_x * right[i] + tan_y * up[i]);
                    let found = sphere.mixed(&plane, sphere.place_of((tan_x, tan_y)));
                    // Straight lines between samples 0.7° apart, at worst half a sample held at the side of a face.
                    assert_abs_diff_eq!(f64::from(found), light(direction), epsilon = 2e-3);
                }
            }
        }
    }

    /// The faces as `ImfEnvmap.cpp` places positions on them, written down apart from how they are read.
    #[test]
    fn cubes_of_openexr_show_what_lies_in_their_directions() {
        let n = 65;
        let on = |at: usize| 2.0 * at as f64 / (n - 1) as f64 - 1.0;
        // What is to the left has the positive x there.
        let plane = Array2::from_shape_fn((6 * n, n), |(row, column)| {
            let (u, v) = (on(column), -on(row % n));
            let [x, y, z] = match row / n {
                0 => [1.0, v, u],
                1 => [-1.0, v, -u],
                2 => [u, 1.0, v],
                3 => [u, -1.0, -v],
                4 => [-u, v, 1.0],
                _ => [u, v, -1.0],
            };
            light([-x, y, z]) as f32
        });
        let kind = |yaw_deg, pitch_deg| Panorama::Cube { yaw_deg, pitch_deg };
        for (yaw_deg, pitch_deg) in [(0.0_f64, 0.0_f64), (90.0, 0.0), (-100.0, 30.0), (180.0, -80.0)] {
            let kind = kind(yaw_deg, pitch_deg);
            let sphere = Sphere::new(Path::new("a"), kind, (6 * n, n), Some(kind)).unwrap();
            let (yaw, pitch) = (yaw_deg.to_radians(), pitch_deg.to_radians());
            for (tan_x, tan_y) in [(0.0, 0.0), (0.9, -0.3), (-3.0, 2.0), (0.1, 4.0)] {
                let right = [yaw.cos(), 0.0, -yaw.sin()];
                let ahead = [yaw.sin() * pitch.cos(), pitch.sin(), yaw.cos() * pitch.cos()];
                let up = [-yaw.sin() * pitch.sin(), pitch.cos(), -yaw.cos() * pitch.sin()];
                let direction = [0, 1, 2].map(|i| ahead[i] + tan_x * right[i] + tan_y * up[i]);
                let found = sphere.mixed(&plane, sphere.place_of((tan_x, tan_y)));
                // Straight lines between samples 1.4° apart.
                assert_abs_diff_eq!(f64::from(found), light(direction), epsilon = 1e-3);
            }
        }
    }

    /// Faces below each other are those side by side, in files that do not say that they are OpenEXR's.
    #[test]
    fn faces_below_each_other_are_those_side_by_side() {
        let kind: Panorama = "cube:100,20".parse().unwrap();
        let sphere = |sides| Sphere::new(Path::new("a"), kind, sides, None).unwrap();
        for at in [(0.0, 0.0), (2.0, 0.5), (-0.5, 3.0)] {
            let ((row, column), (below, left)) = (sphere((8, 48)).place_of(at), sphere((48, 8)).place_of(at));
            let face = (column / 8.0).floor();
            // Single floats.
            assert_abs_diff_eq!(below, row + 8.0 * face, epsilon = 1e-4);
            assert_abs_diff_eq!(left, column - 8.0 * face, epsilon = 1e-4);
        }
    }

    #[test]
    fn distances_of_panoramas_become_depths() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room.png");
        dioptric_pictures::save(&image::RgbImage::from_pixel(64, 32, image::Rgb([128; 3])).into(), &path).unwrap();
        let depth = image::ImageBuffer::from_pixel(64, 32, image::Luma([2000_u16]));
        dioptric_pictures::save(&depth.into(), &folder.path().join("room.depth.png")).unwrap();
        let reading = FileReading { panorama: Some("equirectangular".parse().unwrap()), ..FileReading::default() };
        let options = ReadOptions { reading, horizontal_fov_deg: Some(120.0), ..ReadOptions::default() };
        let scene = read_scene(&path, &options).unwrap();
        let view = scene.require_view().unwrap();
        let z_m = scene.require_depth().unwrap().z_m();
        // All of a ball of 2 m around the camera is 2 m away.
        for (at, z_m) in z_m.indexed_iter() {
            assert_abs_diff_eq!(
                f64::from(*z_m) * view.distance_per_depth(at.0 as f64, at.1 as f64),
                2.0,
                epsilon = 1e-6
            );
        }
        assert!(scene.notes[0].contains("panorama of 64 × 32"), "{}", scene.notes[0]);
        let message = |options: &ReadOptions| read_scene(&path, options).unwrap_err().to_string();
        assert!(message(&ReadOptions { horizontal_fov_deg: None, ..options.clone() }).contains("--fov-deg"));
        let cube = FileReading { panorama: Some("cube".parse().unwrap()), ..FileReading::default() };
        assert!(message(&ReadOptions { reading: cube, ..options }).contains("4 × 3"));
        assert!("fisheye".parse::<Panorama>().is_err() && "cube:1".parse::<Panorama>().is_err());
    }
}
