//! Wavefront OBJ files with their MTL materials.
//!
//! Read here and not by a crate: files that scanners and old programs write have faces of which some lack texture coordinates, vertices of
//! which some have colors, names in Latin-1, and lines that go on after a backslash.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::{DAffine3, DVec3, Vec2, Vec3};

use super::{MAX_BYTES, read_bytes};
use crate::{
    Emission, Encoding, ImageTexture, Material, MaterialId, Relief, Shape, SpectralCurve, Texture, TextureId,
    TriangleMesh, UvMapping, WorldBuilder, WorldError, Wrap,
    mesh::{area_vector, polygon},
};

/// Triangles of one object and material.
struct Part {
    object: String,
    material: Option<String>,
    mesh: TriangleMesh,
    /// The vertex of each triple of the file's numbers, and of its normal smoothed.
    known: HashMap<[u32; 4], u32>,
    /// Vertices whose normal is a smoothed one, with its number.
    smoothed: Vec<(u32, u32)>,
    has: [bool; 3],
}

/// All of a file.
#[derive(Default)]
struct Contents {
    positions: Vec<Vec3>,
    /// Of as many vertices as have one so far, the rest being white.
    colors: Vec<[f32; 4]>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    /// The sums of the faces' normals at each position of a smoothing group.
    smooth_normals: Vec<Vec3>,
    smooth: HashMap<(u32, u32), u32>,
    parts: Vec<Part>,
    by_name: HashMap<(String, Option<String>), usize>,
    libraries: Vec<String>,
    n_lines: usize,
    unknown: Vec<String>,
}

/// None of a kind in a triple of numbers.
const NONE: u32 = u32::MAX;

/// Reads the meshes of an OBJ file, one an object and material, with its name. Materials aren't read, and points and lines, which have no
/// area, are left out.
///
/// # Errors
/// When the file can't be read, or a mesh isn't sound.
pub fn read_obj(path: &Path) -> Result<Vec<(String, TriangleMesh)>, WorldError> {
    let contents = Contents::read(path)?;
    let Contents { parts, smooth_normals, .. } = contents;
    parts.into_iter().map(|part| Ok((part.object.clone(), part.finished(path, &smooth_normals)?))).collect()
}

/// Reads a file with the materials that it names.
pub(super) fn read(path: &Path, unit: f64) -> Result<WorldBuilder, WorldError> {
    let mut builder = WorldBuilder::new();
    builder.add_source(path);
    let contents = Contents::read(path)?;
    if contents.n_lines > 0 {
        builder.note("points and lines, which have no area: left out");
    }
    for word in &contents.unknown {
        builder.note_of("of the file isn't read", word);
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut library = Library { builder, materials: HashMap::new(), made: HashMap::new() };
    for name in &contents.libraries {
        library.read(folder, name)?;
    }
    let place = DAffine3::from_scale(DVec3::splat(unit));
    let Contents { parts, smooth_normals, .. } = contents;
    for part in parts {
        let name = part.material.clone();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let object = Some(&*part.object).filter(|object| !object.is_empty()).or(name.as_deref()).unwrap_or(&stem);
        library.builder.name_next(object);
        let mesh = part.finished(path, &smooth_normals)?;
        let (material, glow) = library.material(name.as_deref(), !mesh.colors.is_empty());
        library.builder.add_shape(Shape::Mesh(mesh), place, material, glow);
    }
    Ok(library.builder)
}

impl Contents {
    fn read(path: &Path) -> Result<Self, WorldError> {
        let text = dioptric_files::text::of_bytes(&read_bytes(path, MAX_BYTES)?);
        let mut contents = Self::default();
        let (mut object, mut material, mut group) = (String::new(), None, 0);
        let mut corners = Vec::new();
        for (line, text) in lines(&text) {
            let wrong = |reason: String| WorldError::Line { file: path.to_owned(), line, reason };
            let mut words = text.split_ascii_whitespace();
            let Some(word) = words.next() else { continue };
            match word {
                "v" => contents.vertex(words).map_err(wrong)?,
                "vt" => {
                    let numbers = numbers(words).map_err(wrong)?;
                    contents.uvs.push(Vec2::new(at(&numbers, 0, 0.0), at(&numbers, 1, 0.0)));
                }
                "vn" => {
                    let numbers = numbers(words).map_err(wrong)?;
                    contents.normals.push(Vec3::new(at(&numbers, 0, 0.0), at(&numbers, 1, 0.0), at(&numbers, 2, 0.0)));
                }
                "f" | "fo" => {
                    corners.clear();
                    for word in words.take_while(|word| !word.starts_with('#')) {
                        corners.push(contents.corner(word).map_err(wrong)?);
                    }
                    contents.face(&corners, (&object, &material), group);
                }
                "p" | "l" => contents.n_lines += 1,
                "o" | "g" => object = rest(&text, word).to_owned(),
                "usemtl" => material = Some(rest(&text, word).to_owned()).filter(|name| !name.is_empty()),
                "mtllib" => contents.libraries.push(rest(&text, word).to_owned()),
                "s" => match words.next() {
                    Some("off" | "null") | None => group = 0,
                    Some("on") => group = 1,
                    Some(number) => match number.parse() {
                        Ok(number) => group = number,
                        Err(_) => contents.note(&format!("s {number}")),
                    },
                },
                // What changes no picture.
                "mg" | "vp" | "bevel" | "c_interp" | "d_interp" | "lod" => {}
                word if word.starts_with('#') => {}
                other => contents.note(other),
            }
        }
        Ok(contents)
    }

    fn note(&mut self, word: &str) {
        if self.unknown.len() < 1000 {
            self.unknown.push(word.chars().take(40).collect());
        }
    }

    fn vertex<'a>(&mut self, words: impl Iterator<Item = &'a str>) -> Result<(), String> {
        let numbers = numbers(words)?;
        let [x, y, z] = match numbers.as_slice() {
            [x, y, z, ..] => [*x, *y, *z],
            found => return Err(format!("a vertex of {} numbers, expected 3", found.len())),
        };
        // A seventh, or a fourth of four, is a weight.
        if let [_, _, _, r, g, b] | [_, _, _, r, g, b, _] | [_, _, _, _, r, g, b, _] = *numbers.as_slice() {
            self.colors.resize(self.positions.len(), [1.0; 4]);
            // Programs write them as they show them.
            let light = |code: f32| dioptric_spectrum::srgb_decode(f64::from(code.clamp(0.0, 1.0))) as f32;
            if [r, g, b].iter().all(|v| v.is_finite()) {
                self.colors.push([light(r), light(g), light(b), 1.0]);
            } else {
                self.note("colors of vertices that aren't numbers");
                self.colors.push([1.0; 4]);
            }
        } else if numbers.len() > 4 {
            self.note(&format!("{} numbers behind a vertex", numbers.len() - 3));
        }
        self.positions.push(Vec3::new(x, y, z));
        Ok(())
    }

    /// Returns the numbers of a corner, from 0, of position, texture and normal.
    fn corner(&self, word: &str) -> Result<[u32; 3], String> {
        let lengths = [self.positions.len(), self.uvs.len(), self.normals.len()];
        let mut corner = [NONE; 3];
        for (place, part) in word.split('/').take(3).enumerate() {
            if part.is_empty() {
                continue;
            }
            let number: i64 = part.parse().map_err(|_| format!("'{word}': expected numbers of vertices"))?;
            let length = lengths[place] as i64;
            let index = if number < 0 { length.saturating_add(number) } else { number - 1 };
            if (0..length).contains(&index) {
                corner[place] = index as u32;
            } else if place == 0 {
                return Err(format!("vertex {number}, of which there are {length} before it"));
            }
        }
        match corner[0] {
            NONE => Err(format!("'{word}': expected a vertex")),
            _ => Ok(corner),
        }
    }

    fn face(&mut self, corners: &[[u32; 3]], (object, material): (&String, &Option<String>), group: u32) {
        if corners.len() < 3 {
            self.n_lines += 1;
            return;
        }
        let key = (object.clone(), material.clone());
        let index = *self.by_name.entry(key).or_insert_with(|| {
            self.parts.push(Part {
                object: object.clone(),
                material: material.clone(),
                mesh: TriangleMesh::default(),
                known: HashMap::new(),
                smoothed: Vec::new(),
                has: [false; 3],
            });
            self.parts.len() - 1
        });
        let Part { mesh, known, smoothed, has: part_has, .. } = &mut self.parts[index];
        let places: Vec<Vec3> = corners.iter().map(|[p, ..]| self.positions[*p as usize]).collect();
        let flat = area_vector(&places).as_vec3();
        let mut triangles = std::mem::take(&mut mesh.triangles);
        let mut vertex = |corner: [u32; 3]| {
            let mut smooth = NONE;
            if group != 0 && corner[2] == NONE {
                let next = self.smooth_normals.len() as u32;
                smooth = *self.smooth.entry((corner[0], group)).or_insert(next);
                if smooth == next {
                    self.smooth_normals.push(Vec3::ZERO);
                }
                self.smooth_normals[smooth as usize] += flat;
            }
            let [p, t, n] = corner;
            *known.entry([p, t, n, smooth]).or_insert_with(|| {
                let [p, t, n] = corner.map(|i| i as usize);
                if smooth != NONE {
                    smoothed.push((mesh.positions.len() as u32, smooth));
                }
                mesh.positions.push(self.positions[p]);
                mesh.uvs.push(self.uvs.get(t).copied().unwrap_or(Vec2::ZERO));
                mesh.normals.push(self.normals.get(n).copied().unwrap_or(Vec3::ZERO));
                let color = self.colors.get(p).copied();
                mesh.colors.push(color.unwrap_or([1.0; 4]));
                let has_normal = self.normals.get(n).is_some() || smooth != NONE;
                let has = [self.uvs.get(t).is_some(), has_normal, color.is_some()];
                *part_has = std::array::from_fn(|k| part_has[k] || has[k]);
                mesh.positions.len() as u32 - 1
            })
        };
        let vertices: Vec<u32> = corners.iter().map(|corner| vertex(*corner)).collect();
        triangles.extend(polygon(&places).into_iter().map(|triangle| triangle.map(|k| vertices[k])));
        mesh.triangles = triangles;
    }
}

impl Part {
    /// Returns the mesh, without what none of its vertices has; where some lack normals theirs are those of their faces.
    fn finished(self, path: &Path, smooth_normals: &[Vec3]) -> Result<TriangleMesh, WorldError> {
        let Self { mut mesh, smoothed, has: [has_uvs, has_normals, has_colors], .. } = self;
        for (vertex, smooth) in smoothed {
            mesh.normals[vertex as usize] = smooth_normals[smooth as usize].normalize_or_zero();
        }
        if !has_uvs {
            mesh.uvs.clear();
        }
        if !has_colors {
            mesh.colors.clear();
        }
        match has_normals {
            false => mesh.normals.clear(),
            true => with_flat_normals(&mut mesh),
        }
        mesh.check().map_err(|e| WorldError::Unreadable { file: path.to_owned(), reason: e.to_string() })?;
        Ok(mesh)
    }
}

/// Gives vertices without a normal that of their face; where faces of several directions share one, each has its own.
fn with_flat_normals(mesh: &mut TriangleMesh) {
    let lacks: Vec<bool> = mesh.normals.iter().map(|n| *n == Vec3::ZERO || !n.is_finite()).collect();
    if !lacks.contains(&true) {
        return;
    }
    let mut is_given = vec![false; lacks.len()];
    for triangle in &mut mesh.triangles {
        let [a, b, c] = triangle.map(|v| mesh.positions[v as usize]);
        let flat = (b - a).cross(c - a).normalize_or_zero();
        for vertex in triangle {
            let v = *vertex as usize;
            if !lacks[v] || is_given[v] && mesh.normals[v] == flat {
                continue;
            }
            if !is_given[v] {
                (is_given[v], mesh.normals[v]) = (true, flat);
                continue;
            }
            *vertex = mesh.positions.len() as u32;
            mesh.positions.push(mesh.positions[v]);
            mesh.normals.push(flat);
            if !mesh.uvs.is_empty() {
                mesh.uvs.push(mesh.uvs[v]);
            }
            if !mesh.colors.is_empty() {
                mesh.colors.push(mesh.colors[v]);
            }
        }
    }
}

/// Returns the lines with their numbers, those that end in a backslash with what follows.
fn lines(text: &str) -> impl Iterator<Item = (usize, std::borrow::Cow<'_, str>)> {
    let mut rest = text.lines().enumerate();
    std::iter::from_fn(move || {
        let (number, first) = rest.next()?;
        let Some(begin) = first.trim_end().strip_suffix('\\') else { return Some((number + 1, first.into())) };
        let mut whole = begin.to_owned();
        for (_, next) in rest.by_ref() {
            let next = next.trim_end();
            let more = next.strip_suffix('\\');
            whole.push(' ');
            whole.push_str(more.unwrap_or(next));
            if more.is_none() {
                break;
            }
        }
        Some((number + 1, whole.into()))
    })
}

/// Returns what follows the first word of a line.
fn rest<'a>(line: &'a str, word: &str) -> &'a str {
    line.trim_start().strip_prefix(word).unwrap_or("").trim()
}

fn numbers<'a>(words: impl Iterator<Item = &'a str>) -> Result<Vec<f32>, String> {
    let number = |word: &str| word.parse::<f32>().map_err(|_| format!("'{}': expected a number", word.escape_debug()));
    words.take_while(|word| !word.starts_with('#')).map(number).collect()
}

fn at(numbers: &[f32], index: usize, default: f32) -> f32 {
    numbers.get(index).copied().unwrap_or(default)
}

/// Materials of MTL files.
struct Library {
    builder: WorldBuilder,
    materials: HashMap<String, Words>,
    /// By name, and whether the mesh has colors.
    made: HashMap<(Option<String>, bool), (MaterialId, Option<Emission>)>,
}

/// What a material's lines say.
#[derive(Default)]
struct Words {
    name: String,
    numbers: HashMap<String, Vec<f32>>,
    pictures: HashMap<String, PictureWords>,
}

impl Words {
    fn number(&self, word: &str, default: f32) -> f32 {
        self.numbers.get(word).map_or(default, |numbers| at(numbers, 0, default))
    }

    fn color(&self, word: &str) -> Option<[f32; 3]> {
        let numbers = self.numbers.get(word)?;
        let first = at(numbers, 0, 0.0);
        Some([first, at(numbers, 1, first), at(numbers, 2, first)])
    }

    /// Returns how much of it is there.
    fn opaque(&self) -> f32 {
        match (self.numbers.get("d"), self.numbers.get("tr")) {
            (Some(d), _) => at(d, 0, 1.0).clamp(0.0, 1.0),
            // Meshlab and others write how opaque a material is: one of which nothing could be seen is theirs.
            (None, Some(tr)) if at(tr, 0, 0.0) >= 1.0 => 1.0,
            (None, Some(tr)) => 1.0 - at(tr, 0, 0.0).max(0.0),
            (None, None) => 1.0,
        }
    }

    /// Returns the share of clear matter in a material that refracts (`illum` 4, 6, 7 and 9), of which light that isn't refracted has none.
    fn clear(&self) -> f32 {
        let is_said = ["d", "tr"].iter().any(|word| self.numbers.contains_key(*word));
        match self.number("illum", 2.0) as i32 {
            4 | 6 | 7 | 9 if is_said => 1.0 - self.opaque(),
            4 | 6 | 7 | 9 if self.numbers.contains_key("tf") => 1.0,
            _ => 0.0,
        }
    }
}

/// Words that are read, or change no picture: ambient light, the choice of a program's shading.
const OF_COLORS: [&str; 12] = ["kd", "ka", "ks", "ke", "ns", "ni", "d", "tr", "tf", "illum", "pr", "pm"];
const OF_PICTURES: [&str; 12] =
    ["map_kd", "map_d", "map_ke", "map_bump", "bump", "norm", "map_pr", "map_pm", "map_ks", "map_ns", "map_ka", "refl"];
/// Those whose numbers are shares.
const SHARES: [&str; 5] = ["kd", "ks", "d", "pr", "pm"];

impl Library {
    fn read(&mut self, folder: &Path, name: &str) -> Result<(), WorldError> {
        // A name may have blanks, and a line several names, whose own blanks have a stroke before them.
        let whole = beside(folder, name);
        let parted = name.replace("\\ ", "\0");
        let parted = parted.split_ascii_whitespace().map(|name| name.replace('\0', " "));
        let names: Vec<String> = if whole.is_file() { vec![name.to_owned()] } else { parted.collect() };
        for name in names {
            let path = beside(folder, &name);
            self.builder.add_source(&path);
            if !path.is_file() {
                self.builder.note_of("libraries of materials that aren't there, gray in their place", &name);
                continue;
            }
            let text = dioptric_files::text::of_bytes(&read_bytes(&path, MAX_BYTES)?);
            let folder = path.parent().unwrap_or(Path::new("")).to_owned();
            let mut words: Option<Words> = None;
            for (_, line) in lines(&text) {
                let mut parts = line.split_ascii_whitespace();
                let Some(word) = parts.next().filter(|word| !word.starts_with('#')) else { continue };
                let lower = word.to_ascii_lowercase();
                if lower == "newmtl" {
                    self.keep(words.replace(Words { name: rest(&line, word).to_owned(), ..Words::default() }));
                    continue;
                }
                let known = OF_COLORS.contains(&lower.as_str()) || OF_PICTURES.contains(&lower.as_str());
                let Some(words) = words.as_mut().filter(|_| known) else {
                    self.builder.note_of("words of materials that aren't known, left out", word);
                    continue;
                };
                if OF_PICTURES.contains(&lower.as_str()) {
                    let (file, picture, left) = picture_words(rest(&line, word));
                    for option in left {
                        self.builder.note_of("options of pictures that aren't known, left out", option);
                    }
                    words.pictures.insert(lower, PictureWords { file: beside(&folder, file), ..picture });
                    continue;
                }
                match numbers(parts) {
                    Ok(mut numbers) if !numbers.is_empty() && numbers.iter().all(|v| v.is_finite()) => {
                        if SHARES.contains(&lower.as_str()) && numbers.iter().any(|v| !(0.0..=1.0).contains(v)) {
                            self.builder.note_of("shares of materials beyond 0 to 1, the nearest in their place", word);
                            numbers.iter_mut().for_each(|v| *v = v.clamp(0.0, 1.0));
                        }
                        words.numbers.insert(lower, numbers);
                    }
                    _ => self.builder.note_of("words of materials without numbers, left out", word),
                }
            }
            self.keep(words);
        }
        Ok(())
    }

    fn keep(&mut self, words: Option<Words>) {
        if let Some(words) = words {
            self.materials.insert(words.name.clone(), words);
        }
    }

    /// Returns the material of a name and its glow; with the colors of a mesh.
    fn material(&mut self, name: Option<&str>, has_colors: bool) -> (MaterialId, Option<Emission>) {
        let key = (name.map(str::to_owned).filter(|name| self.materials.contains_key(name)), has_colors);
        if let (Some(name), None) = (name, &key.0) {
            self.builder.note_of("materials that are named and not there, gray in their place", name);
        }
        if let Some(made) = self.made.get(&key) {
            return made.clone();
        }
        let words = key.0.as_ref().and_then(|name| self.materials.remove(name));
        let made = match &words {
            Some(words) => self.new_material(words, has_colors),
            None => (super::plain(&mut self.builder, has_colors), None),
        };
        self.keep(words);
        self.made.insert(key, made.clone());
        made
    }

    fn even(&mut self, value: f32) -> TextureId {
        self.builder.add_texture(Texture::Curve(SpectralCurve::constant(value)))
    }

    /// Adds a material: Lambert's base and a layer that mirrors as glTF's does, which has nearly the look of Phong's highlight; or clear
    /// matter.
    fn new_material(&mut self, words: &Words, has_colors: bool) -> (MaterialId, Option<Emission>) {
        // Colors are written as they are shown by some programs and in linear light by others; most since 2010 the latter.
        let has_picture = words.pictures.contains_key("map_kd");
        let base = words.color("kd").unwrap_or(if has_picture { [1.0; 3] } else { [0.8; 3] });
        let mut diffuse = self.builder.add_texture(Texture::Curve(SpectralCurve::from_rgb_reflectance(base)));
        let picture = self.picture(words, "map_kd", Encoding::Srgb);
        if let Some(texture) = picture {
            // A picture replaces black, which exporters leave beside it.
            diffuse = match base {
                [0.0, 0.0, 0.0] => texture,
                _ => self.builder.add_texture(Texture::Product([diffuse, texture])),
            };
        }
        if has_colors {
            let colors = self.builder.add_texture(Texture::VertexColors);
            diffuse = self.builder.add_texture(Texture::Product([diffuse, colors]));
        }
        let illum = words.number("illum", 2.0) as i32;
        let shine = words.number("ns", 0.0).max(0.0);
        let mirrored = words.color("ks").filter(|_| illum >= 2).unwrap_or([0.0; 3]);
        if matches!(illum, 3 | 5 | 8) && mirrored != [0.0; 3] {
            self.builder.note_of("materials that mirror what is around them: as their highlight does", &words.name);
        }
        let [has_roughness, has_metal] = [["pr", "map_pr"], ["pm", "map_pm"]]
            .map(|[number, picture]| words.numbers.contains_key(number) || words.pictures.contains_key(picture));
        let is_matte = mirrored == [0.0; 3] && !has_roughness && !has_metal;
        let material = if is_matte {
            Material::Matte { reflectance: diffuse }
        } else {
            // Phong's exponent as GGX's width: α² = 2/(Ns + 2); its highlight as that of a layer of index 1.5 at the most, where it is no
            // mirror. Ks of 1 is what exporters write for "as usual".
            let largest = mirrored.into_iter().fold(0.0, f32::max);
            let layer = if has_roughness { [1.0; 3] } else { mirrored };
            let has_layer = layer != [0.0; 3];
            let rough = if has_roughness { words.number("pr", 1.0) } else { (2.0 / (shine + 2.0)).sqrt().sqrt() };
            let metallic = self.channel(words, "map_pm", words.number("pm", 0.0));
            let roughness = self.channel(words, "map_pr", rough);
            let layer = SpectralCurve::from_rgb_reflectance(layer).scaled(0.04);
            Material::MetallicRoughness {
                color: diffuse,
                metallic,
                roughness,
                mirrored: self.builder.add_texture(Texture::Curve(layer)),
                edge: self.even(largest.max(if has_layer { 1.0 } else { 0.0 })),
                transmission: None,
                brushed: None,
            }
        };
        let relief = self.relief(words);
        let clear = words.clear();
        let id = if clear > 0.0 {
            let index = words.number("ni", 1.5).clamp(1.0, 4.0);
            let filter = words.color("tf").unwrap_or([1.0; 3]).map(|v| v.clamp(0.0, 1.0));
            let glass = Material::Glass {
                reflectance: self.even(1.0),
                transmittance: self.builder.add_texture(Texture::Curve(SpectralCurve::from_rgb_reflectance(filter))),
                index: SpectralCurve::constant(index),
                roughness: None,
            };
            let of = [material, glass].map(|part| self.builder.add_material(&words.name, part));
            let amount = self.even(clear);
            self.builder.add_material_with(&words.name, Material::Blend { of, amount }, relief)
        } else {
            if words.color("tf").is_some_and(|tf| tf != [1.0; 3] && tf != [0.0; 3]) {
                self.builder.note_of(
                    "filters of light that goes through, of materials that don't refract: left out",
                    &words.name,
                );
            }
            self.builder.add_material_with(&words.name, material, relief)
        };
        let opaque = if clear > 0.0 { 1.0 } else { words.opaque() };
        let alpha = match words.pictures.contains_key("map_d") {
            true => Some(self.channel(words, "map_d", opaque)),
            false if opaque < 1.0 => Some(self.even(opaque)),
            false => None,
        };
        if let Some(alpha) = alpha {
            self.builder.set_coverage(id, alpha);
        }
        for word in ["map_ks", "map_ns", "refl"].into_iter().filter(|word| words.pictures.contains_key(*word)) {
            self.builder.note_of("pictures of highlights and surroundings, left out", word);
        }
        let glow = words.color("ke").filter(|glow| glow.iter().any(|v| *v > 0.0)).map(|glow| {
            self.builder.note("a glow of 1 is taken as that of 1 W m⁻² sr⁻¹ nm⁻¹");
            if let Some(texture) = self.picture(words, "map_ke", Encoding::Srgb) {
                self.builder.set_glow(id, texture);
            }
            Emission { radiance: SpectralCurve::from_rgb_light(glow), is_two_sided: true }
        });
        if glow.is_none() && words.pictures.contains_key("map_ke") {
            self.builder.note_of("pictures of a glow without a Ke: left out", &words.name);
        }
        (id, glow)
    }

    fn relief(&mut self, words: &Words) -> Option<Relief> {
        if let Some(texture) = self.picture(words, "norm", Encoding::Linear) {
            return Some(Relief::Normals(texture));
        }
        let word = ["map_bump", "bump"].into_iter().find(|word| words.pictures.contains_key(*word))?;
        self.builder.note_of("heights of a unit that isn't said, left out", word);
        None
    }

    /// Returns the picture of a word, laid as its options say.
    fn picture(&mut self, words: &Words, word: &str, encoding: Encoding) -> Option<TextureId> {
        let of = words.pictures.get(word)?;
        let image = Arc::new(picture(&mut self.builder, &of.file, encoding)?.sampled([of.wrap; 2], false));
        if of.base != 0.0 {
            self.builder.note_of("what is added to a picture's values, left out", word);
        }
        Some(self.builder.add_texture(Texture::Image { image, mapping: of.mapping, scale: of.gain }))
    }

    /// Returns the channel of a word's picture times a factor, or the factor alone.
    fn channel(&mut self, words: &Words, word: &str, factor: f32) -> TextureId {
        let found =
            words.pictures.get(word).and_then(|of| Some((of, picture(&mut self.builder, &of.file, Encoding::Linear)?)));
        let Some((of, image)) = found else { return self.even(factor) };
        let channel = of.channel.unwrap_or(if word == "map_d" && image.has_alpha() { 3 } else { 0 });
        // Exporters leave 0 beside a picture.
        let factor = if word == "map_d" || factor > 0.0 { factor } else { 1.0 };
        let image = Arc::new(image.sampled([of.wrap; 2], false));
        let (scale, offset) = (of.gain * factor, of.base * factor);
        self.builder.add_texture(Texture::Channel { image, channel, mapping: of.mapping, scale, offset })
    }
}

/// Reads a picture; none, with a note, where it can't be read.
pub(super) fn picture(builder: &mut WorldBuilder, path: &Path, encoding: Encoding) -> Option<Arc<ImageTexture>> {
    builder.add_source(path);
    match ImageTexture::read(path, encoding, Wrap::Repeat) {
        Ok(image) => Some(Arc::new(image)),
        Err(error) => {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if path.is_file() {
                builder.note_of("pictures that can't be read, left out", &error.of_picture(&name));
            } else {
                builder.note_of("pictures that aren't there, left out", &name);
            }
            None
        }
    }
}

/// A picture of a material and how it is laid: its values times a gain and more than a base.
#[derive(Clone, Debug, PartialEq)]
struct PictureWords {
    file: PathBuf,
    mapping: UvMapping,
    wrap: Wrap,
    base: f32,
    gain: f32,
    channel: Option<usize>,
}

/// Returns the name of a picture after its options, how it is laid, and the options that aren't known.
fn picture_words(text: &str) -> (&str, PictureWords, Vec<&str>) {
    let mut words = PictureWords {
        file: PathBuf::new(),
        mapping: UvMapping::IDENTITY,
        wrap: Wrap::Repeat,
        base: 0.0,
        gain: 1.0,
        channel: None,
    };
    let (mut rest, mut left) = (text.trim(), Vec::new());
    let (mut offset, mut scale) = (Vec2::ZERO, Vec2::ONE);
    while let Some(option) = rest.strip_prefix('-') {
        let (name, after) = option.split_once(char::is_whitespace).unwrap_or((option, ""));
        let n_values = match name {
            "o" | "s" | "t" => 3,
            "mm" => 2,
            _ => 1,
        };
        rest = after.trim_start();
        let (mut numbers, mut word) = (Vec::new(), "");
        for place in 0..n_values {
            let (value, after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
            let number = value.parse::<f32>();
            // Offsets and scales may have fewer numbers than three.
            if place > 0 && number.is_err() {
                break;
            }
            numbers.extend(number);
            word = value;
            rest = after.trim_start();
        }
        match (name, numbers.as_slice(), word) {
            ("o", [x, more @ ..], _) => offset = Vec2::new(*x, at(more, 0, 0.0)),
            ("s", [x, more @ ..], _) => scale = Vec2::new(*x, at(more, 0, 1.0)),
            ("mm", [base, gain], _) => (words.base, words.gain) = (*base, *gain),
            ("clamp", _, "on") => words.wrap = Wrap::Clamp,
            ("imfchan", _, "r" | "g" | "b" | "m") => words.channel = "rgbm".find(word),
            // Of how a picture is filtered, and how strong heights are, which are left out themselves.
            ("clamp", _, "off") | ("blendu" | "blendv", _, "on" | "off") | ("boost" | "texres" | "bm", [_], _) => {}
            _ => left.push(name),
        }
    }
    words.mapping = UvMapping::scaled(scale, offset);
    (rest, words, left)
}

/// Returns a file that is named beside another, of Windows' separators too.
pub(super) fn beside(folder: &Path, name: &str) -> PathBuf {
    let name = name.trim_matches('"');
    let path = folder.join(name);
    if path.is_file() {
        return path;
    }
    let path = folder.join(name.replace('\\', "/"));
    if path.is_file() {
        return path;
    }
    // A path of another machine: the file may lie beside.
    let last = name.rsplit(['\\', '/']).next().unwrap_or(name);
    let near = folder.join(last);
    if near.is_file() { near } else { path }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &[u8]) -> Result<Vec<(String, TriangleMesh)>, WorldError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("two.obj");
        std::fs::write(&path, text).unwrap();
        read_obj(&path)
    }

    #[test]
    fn objects_are_read_with_normals_and_textures() {
        let text = "o first\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1 4/1/1\n\
                    o second\nf 1 2 3\n";
        let meshes = read_text(text.as_bytes()).unwrap();
        assert_eq!(meshes.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["first", "second"]);
        assert_eq!((meshes[0].1.triangles.len(), meshes[1].1.triangles.len()), (2, 1));
        assert!(meshes[0].1.normals.iter().all(|n| *n == Vec3::Z) && meshes[1].1.normals.is_empty());
        // Lines between vertices have no normals of their own.
        assert_eq!(read_text(text.replace("o second", "l 1 2\np 3\no second").as_bytes()).unwrap(), meshes);
        assert!(read_text(b"v 0 0\nf 1 2 3\n").unwrap_err().to_string().contains("two.obj: line 1"));
        assert!(read_text(b"v 0 0 0\nf 1 2 3\n").unwrap_err().to_string().contains("vertex 2, of which there are 1"));
    }

    /// What programs write that others refuse.
    #[test]
    fn faces_and_vertices_may_lack_what_others_have() {
        let corners = "v 0 0 0 1 0 0\nv 1 0 0\nv 1 1 0\nvt 1 1\nvn 0 0 1\nusemtl \n";
        let meshes = read_text(format!("{corners}f 1/1/1 2 3//1\nf -3 -2 \\\n -1\n").as_bytes()).unwrap();
        let mesh = &meshes[0].1;
        assert_eq!((meshes.len(), mesh.triangles.len()), (1, 2));
        assert!(mesh.normals.iter().all(|n| *n == Vec3::Z), "{:?}", mesh.normals);
        assert_eq!((mesh.uvs[0], mesh.uvs[1]), (Vec2::ONE, Vec2::ZERO));
        assert_eq!((mesh.colors[0], mesh.colors[1]), ([1.0, 0.0, 0.0, 1.0], [1.0; 4]));
        // Latin-1, and UTF-16.
        let named = read_text(b"o W\xfcrfel\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n").unwrap();
        assert_eq!(named[0].0, "Würfel");
        let wide: Vec<u8> = [0xfeff]
            .into_iter()
            .chain("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n".encode_utf16())
            .flat_map(u16::to_be_bytes)
            .collect();
        assert_eq!(read_text(&wide).unwrap()[0].1.triangles.len(), 1);
    }

    #[test]
    fn options_of_pictures_are_read() {
        let laid = |text| {
            let (name, words, left) = picture_words(text);
            (name, words.mapping, words.wrap, left)
        };
        let even = UvMapping::IDENTITY;
        let twice = UvMapping::scaled(Vec2::new(2.0, 3.0), Vec2::ZERO);
        assert_eq!(laid("-s 2 3 1 -bm 0.5 my picture.png"), ("my picture.png", twice, Wrap::Repeat, vec![]));
        let moved = UvMapping::scaled(Vec2::ONE, Vec2::new(0.1, 0.0));
        assert_eq!(laid("-o 0.1 -clamp on a.png"), ("a.png", moved, Wrap::Clamp, vec![]));
        assert_eq!(laid("-cc on -quux 3 a.png"), ("a.png", even, Wrap::Repeat, vec!["cc", "quux"]));
        assert_eq!(laid("a.png"), ("a.png", even, Wrap::Repeat, vec![]));
        assert_eq!(picture_words("-mm 0.1 0.5 -imfchan g a.png").1.channel, Some(1));
    }

    #[test]
    fn materials_are_those_of_the_library() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        write("m.mtl", "newmtl red paint\nKd 1 0 0\nKs 0 0 0\nnewmtl half\nKd 0 0 0\nd 0.5\nKe 1 1 1\nfoo 3\n");
        write(
            "a.obj",
            "mtllib m.mtl\nv -1 -1 0\nv 1 -1 0\nv 0 1 0\nv -1 -1 -1\nv 1 -1 -1\nv 0 1 -1\nusemtl red paint\nf 4 5 6\nusemtl half\nf 1 2 3\nusemtl gone\nf 1 2 3\n",
        );
        let path = folder.path().join("a.obj");
        let world =
            crate::read_world(&path, &crate::ReadOptions::default(), &dioptric_spectrum::Cancel::new()).unwrap();
        assert_eq!(world.material_names().collect::<Vec<_>>()[..2], ["red paint", "half"]);
        let notes = world.notes().join("\n");
        assert!(notes.contains("gone") && notes.contains("foo"), "{notes}");
        assert_eq!(world.sources().len(), 2);
    }

    #[test]
    fn names_of_libraries_have_blanks() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("my paints.mtl"), "newmtl red\nKd 1 0 0\n").unwrap();
        for names in ["my paints.mtl", "none.mtl my\\ paints.mtl"] {
            let text = format!("mtllib {names}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n");
            std::fs::write(folder.path().join("a.obj"), text).unwrap();
            let (path, cancel) = (folder.path().join("a.obj"), dioptric_spectrum::Cancel::new());
            let world = crate::read_world(&path, &crate::ReadOptions::default(), &cancel).unwrap();
            assert_eq!(world.material_names().next(), Some("red"), "{names}");
        }
    }

    /// `Tr 1`, by which nothing could be seen, is what Meshlab writes of opaque materials.
    #[test]
    fn transparent_in_full_is_opaque() {
        let folder = tempfile::tempdir().unwrap();
        for (words, is_seen) in [("Tr 1.0", true), ("Tr 0", true), ("d 0", false)] {
            std::fs::write(folder.path().join("m.mtl"), format!("newmtl a\nKd 1 1 1\n{words}\n")).unwrap();
            let path = folder.path().join("a.obj");
            std::fs::write(&path, "mtllib m.mtl\nusemtl a\nv -1 -1 0\nv 1 -1 0\nv 0 1 0\nf 1 2 3\n").unwrap();
            let options = crate::ReadOptions::default();
            let world = crate::read_world(&path, &options, &dioptric_spectrum::Cancel::new()).unwrap();
            let ray = crate::Ray { origin: Vec3::Z, direction: Vec3::NEG_Z };
            assert_eq!(world.intersect(&ray, 9.0).is_some(), is_seen, "{words}");
        }
    }

    /// A roof of two faces at right angles: over its ridge normals are between them where a smoothing group holds both.
    #[test]
    fn smoothing_groups_have_normals_between_their_faces() {
        let roof = "v 0 0 0\nv 0 0 1\nv 1 -1 0\nv 1 -1 1\nv -1 -1 0\nv -1 -1 1\n";
        let normals = |groups: [&str; 2]| {
            let text = format!("{roof}s {}\nf 1 2 4 3\ns {}\nf 2 1 5 6\n", groups[0], groups[1]);
            read_text(text.as_bytes()).unwrap().remove(0).1
        };
        let smooth = normals(["7", "7"]);
        assert_eq!(smooth.positions.len(), 6);
        assert!(smooth.normals[0].abs_diff_eq(Vec3::Y, 1e-6), "{:?}", smooth.normals);
        let sharp = normals(["1", "2"]);
        assert_eq!(sharp.positions.len(), 8);
        assert!(sharp.normals[0].abs_diff_eq(Vec3::new(1.0, 1.0, 0.0).normalize(), 1e-6), "{:?}", sharp.normals);
        assert!(normals(["off", "0"]).normals.is_empty());
        // Beside a smoothed face those without a group keep their edges.
        let text = format!("{roof}s 1\nf 1 2 4 3\ns off\nf 2 1 5 6\nf 5 6 4 3\n");
        let mesh = read_text(text.as_bytes()).unwrap().remove(0).1;
        for t in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(t);
            let flat = (b - a).cross(c - a).normalize();
            let is_flat = |v: u32| mesh.normals[v as usize].abs_diff_eq(flat, 1e-6);
            assert!(mesh.triangles[t].into_iter().all(is_flat), "{t}: {:?}", mesh.normals);
        }
    }

    /// Reads one triangle across the origin of a material; returns its albedo, seen along −z, and whether it is met.
    fn albedo_of(material: &str, colors: &str) -> [f32; 2] {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("m.mtl"), format!("newmtl a\n{material}\n")).unwrap();
        let path = folder.path().join("a.obj");
        let text = format!("mtllib m.mtl\nusemtl a\nv -1 -1 0{colors}\nv 1 -1 0{colors}\nv 0 1 0{colors}\nf 1 2 3\n");
        std::fs::write(&path, text).unwrap();
        let world =
            crate::read_world(&path, &crate::ReadOptions::default(), &dioptric_spectrum::Cancel::new()).unwrap();
        let hit = world.intersect(&crate::Ray { origin: Vec3::Z, direction: Vec3::NEG_Z }, 9.0).unwrap();
        world.bsdf(&hit, Vec3::Z, &[450.0, 650.0]).albedo()
    }

    /// Glass by the choice of illumination 7 takes nothing but by its filter; colors of vertices and the material's multiply.
    #[test]
    fn glass_and_colors_of_vertices_are_followed() {
        let clear = albedo_of("Kd 0 0 0\nNi 1.5\nd 0\nillum 7", "");
        assert!(clear.iter().all(|a| (a - 1.0).abs() < 1e-5), "{clear:?}");
        // 4 % are mirrored, of the rest a tenth goes through.
        let filtered = albedo_of("Kd 0 0 0\nNi 1.5\nTf 0.1 0.1 0.1\nillum 6", "");
        assert!(filtered.iter().all(|a| (a - (0.04 + 0.096)).abs() < 2e-3), "{filtered:?}");
        let [both, one] = [albedo_of("Kd 0.5 0.5 0.5", " 1 0 0"), albedo_of("Kd 1 1 1", " 1 0 0")];
        assert!((both[1] - 0.5 * one[1]).abs() < 1e-3 && both[0] < 0.1 && one[1] > 0.9, "{both:?} {one:?}");
    }
}
