//! Wavefront OBJ files with their MTL materials.
//!
//! Read here and not by a crate: files that scanners and old programs write have faces of which some lack texture coordinates, vertices of
//! which some have colors, names in Latin-1, and lines that go on after a backslash.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
};

use glam::{DAffine3, DVec3, Vec2, Vec3};

use super::{MAX_BYTES, read_bytes};
use crate::{
    Emission, Encoding, ImageTexture, Material, MaterialId, Relief, Shape, SpectralCurve, Texture, TriangleMesh,
    UvMapping, WorldBuilder, WorldError, Wrap,
};

/// Triangles of one object and material.
struct Part {
    object: String,
    material: Option<String>,
    mesh: TriangleMesh,
    /// The vertex of each triple of the file's numbers.
    known: HashMap<[u32; 3], u32>,
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
    contents.parts.into_iter().map(|part| Ok((part.object.clone(), part.finished(path)?))).collect()
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
        builder.note_of("words that aren't known, left out", word);
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut library = Library { builder, materials: HashMap::new(), glows: HashMap::new() };
    for name in &contents.libraries {
        library.read(folder, name)?;
    }
    let Library { mut builder, materials, glows } = library;
    let place = DAffine3::from_scale(DVec3::splat(unit));
    let mut plain: HashMap<bool, MaterialId> = HashMap::new();
    for part in contents.parts {
        let name = part.material.clone();
        let mesh = part.finished(path)?;
        let named = name.as_ref().and_then(|name| materials.get(name).copied());
        if let (Some(name), None) = (&name, named) {
            builder.note_of("materials that are named and not there, gray in their place", name);
        }
        let has_colors = !mesh.colors.is_empty();
        let material = match named {
            Some(material) => material,
            None => *plain.entry(has_colors).or_insert_with(|| super::plain(&mut builder, has_colors)),
        };
        let glow = name.and_then(|name| glows.get(&name).cloned());
        builder.add_shape(Shape::Mesh(mesh), place, material, glow);
    }
    Ok(builder)
}

impl Contents {
    fn read(path: &Path) -> Result<Self, WorldError> {
        let text = dioptric_files::text::of_bytes(&read_bytes(path, MAX_BYTES)?);
        let mut contents = Self::default();
        let (mut object, mut material) = (String::new(), None);
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
                    for word in words {
                        corners.push(contents.corner(word).map_err(wrong)?);
                    }
                    contents.face(&corners, (&object, &material));
                }
                "p" | "l" => contents.n_lines += 1,
                "o" | "g" => object = rest(&text, word).to_owned(),
                "usemtl" => material = Some(rest(&text, word).to_owned()).filter(|name| !name.is_empty()),
                "mtllib" => contents.libraries.push(rest(&text, word).to_owned()),
                // Smoothing, groups and what changes no picture.
                "s" | "mg" | "vp" | "bevel" | "c_interp" | "d_interp" | "lod" | "usemap" | "maplib" | "shadow_obj"
                | "trace_obj" | "csh" => {}
                word if word.starts_with('#') => {}
                other if contents.unknown.len() < 1000 => contents.unknown.push(other.chars().take(40).collect()),
                _ => {}
            }
        }
        Ok(contents)
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
            self.colors.push([light(r), light(g), light(b), 1.0]);
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

    fn face(&mut self, corners: &[[u32; 3]], (object, material): (&String, &Option<String>)) {
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
                has: [false; 3],
            });
            self.parts.len() - 1
        });
        let Part { mesh, known, has: part_has, .. } = &mut self.parts[index];
        let mut triangles = std::mem::take(&mut mesh.triangles);
        let mut vertex = |corner: [u32; 3]| {
            *known.entry(corner).or_insert_with(|| {
                let [p, t, n] = corner.map(|i| i as usize);
                mesh.positions.push(self.positions[p]);
                mesh.uvs.push(self.uvs.get(t).copied().unwrap_or(Vec2::ZERO));
                mesh.normals.push(self.normals.get(n).copied().unwrap_or(Vec3::ZERO));
                let color = self.colors.get(p).copied();
                mesh.colors.push(color.unwrap_or([1.0; 4]));
                let has = [self.uvs.get(t).is_some(), self.normals.get(n).is_some(), color.is_some()];
                *part_has = std::array::from_fn(|k| part_has[k] || has[k]);
                mesh.positions.len() as u32 - 1
            })
        };
        let first = vertex(corners[0]);
        for pair in corners[1..].windows(2) {
            triangles.push([first, vertex(pair[0]), vertex(pair[1])]);
        }
        mesh.triangles = triangles;
    }
}

impl Part {
    /// Returns the mesh, without what none of its vertices has; where some lack normals theirs are those of their faces.
    fn finished(self, path: &Path) -> Result<TriangleMesh, WorldError> {
        let Self { mut mesh, has: [has_uvs, has_normals, has_colors], .. } = self;
        if !has_uvs {
            mesh.uvs.clear();
        }
        if !has_colors {
            mesh.colors.clear();
        }
        match has_normals {
            false => mesh.normals.clear(),
            true => {
                for triangle in &mesh.triangles {
                    let [a, b, c] = triangle.map(|v| mesh.positions[v as usize]);
                    let flat = (b - a).cross(c - a).normalize_or_zero();
                    for &vertex in triangle {
                        let normal = &mut mesh.normals[vertex as usize];
                        if *normal == Vec3::ZERO || !normal.is_finite() {
                            *normal = flat;
                        }
                    }
                }
            }
        }
        mesh.check().map_err(|e| WorldError::Unreadable { file: path.to_owned(), reason: e.to_string() })?;
        Ok(mesh)
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
    materials: HashMap<String, MaterialId>,
    glows: HashMap<String, Emission>,
}

/// What a material's lines say.
#[derive(Default)]
struct Words {
    name: String,
    numbers: HashMap<String, Vec<f32>>,
    pictures: HashMap<String, (PathBuf, f32)>,
}

/// Words that are read, or change no picture: ambient light, the choice of a program's shading, its reflection of surroundings.
const OF_COLORS: [&str; 12] = ["kd", "ka", "ks", "ke", "ns", "ni", "d", "tr", "tf", "illum", "pr", "pm"];
const OF_PICTURES: [&str; 12] =
    ["map_kd", "map_d", "map_ke", "map_bump", "bump", "norm", "map_pr", "map_pm", "map_ks", "map_ns", "map_ka", "refl"];

impl Library {
    fn read(&mut self, folder: &Path, name: &str) -> Result<(), WorldError> {
        // A name may have blanks, and a line several names.
        let whole = beside(folder, name);
        let names: Vec<&str> = if whole.is_file() { vec![name] } else { name.split_ascii_whitespace().collect() };
        for name in names {
            let path = beside(folder, name);
            self.builder.add_source(&path);
            if !path.is_file() {
                self.builder.note_of("libraries of materials that aren't there, gray in their place", name);
                continue;
            }
            let text = dioptric_files::text::of_bytes(&read_bytes(&path, MAX_BYTES)?);
            let folder = path.parent().unwrap_or(Path::new("")).to_owned();
            let mut words: Option<Words> = None;
            for (_, line) in lines(&text) {
                let mut parts = line.split_ascii_whitespace();
                let Some(word) = parts.next() else { continue };
                let lower = word.to_ascii_lowercase();
                if lower == "newmtl" {
                    self.finish(words.replace(Words { name: rest(&line, word).to_owned(), ..Words::default() }))?;
                    continue;
                }
                let Some(words) = &mut words else { continue };
                if OF_COLORS.contains(&lower.as_str()) {
                    match numbers(parts) {
                        Ok(numbers) => {
                            words.numbers.insert(lower, numbers);
                        }
                        Err(_) => self.builder.note_of("words of materials without numbers, left out", word),
                    }
                } else if OF_PICTURES.contains(&lower.as_str()) {
                    let (file, strength) = picture_words(rest(&line, word));
                    words.pictures.insert(lower, (beside(&folder, file), strength));
                } else if !word.starts_with('#') {
                    self.builder.note_of("words of materials that aren't known, left out", word);
                }
            }
            self.finish(words)?;
        }
        Ok(())
    }

    /// Adds a material: Lambert's base and a layer that mirrors as glTF's does, which has nearly the look of Phong's highlight.
    fn finish(&mut self, words: Option<Words>) -> Result<(), WorldError> {
        let Some(words) = words else { return Ok(()) };
        let number = |word: &str, default: f32| words.numbers.get(word).map_or(default, |n| at(n, 0, default));
        let color = |word: &str| {
            let n = words.numbers.get(word)?;
            let first = at(n, 0, 0.0);
            Some([first, at(n, 1, first), at(n, 2, first)])
        };
        // Colors are written as they are shown by some programs and in linear light by others; most since 2010 the latter.
        let base = color("kd").unwrap_or(if words.pictures.contains_key("map_kd") { [1.0; 3] } else { [0.8; 3] });
        let mut diffuse = self.builder.add_texture(Texture::Curve(SpectralCurve::from_rgb_reflectance(base)));
        let picture = self.picture(&words, "map_kd", Encoding::Srgb);
        if let Some(image) = &picture {
            let texture = self.builder.add_texture(laid(image));
            // A picture replaces black, which exporters leave beside it.
            diffuse = match base {
                [0.0, 0.0, 0.0] => texture,
                _ => self.builder.add_texture(Texture::Product([diffuse, texture])),
            };
        }
        let illum = number("illum", 2.0) as i32;
        let shine = number("ns", 0.0).max(0.0);
        let mirrored = color("ks").filter(|_| illum >= 2).unwrap_or([0.0; 3]);
        let is_matte = mirrored == [0.0; 3] && !words.numbers.contains_key("pr") && !words.numbers.contains_key("pm");
        let opaque = match (words.numbers.get("d"), words.numbers.get("tr")) {
            (Some(d), _) => at(d, 0, 1.0),
            // Meshlab and others write how opaque a material is: one of which nothing could be seen is theirs.
            (None, Some(tr)) if at(tr, 0, 0.0) >= 1.0 => 1.0,
            (None, Some(tr)) => 1.0 - at(tr, 0, 0.0),
            (None, None) => 1.0,
        };
        let even = |builder: &mut WorldBuilder, value: f32| {
            builder.add_texture(Texture::Curve(SpectralCurve::constant(value)))
        };
        let material = if is_matte {
            Material::Matte { reflectance: diffuse }
        } else {
            // Phong's exponent as GGX's width: α² = 2/(Ns + 2); its highlight as that of a layer of index 1.5 at the most, where it is no
            // mirror. Ks of 1 is what exporters write for "as usual".
            let largest = mirrored.into_iter().fold(0.0, f32::max);
            let metallic = number("pm", 0.0).clamp(0.0, 1.0);
            let rough = match words.numbers.get("pr") {
                Some(pr) => at(pr, 0, 0.5),
                None => (2.0 / (shine + 2.0)).sqrt().sqrt(),
            };
            let layer = if words.numbers.contains_key("pr") { 0.04 } else { 0.04 * largest.min(1.0) };
            let curve = SpectralCurve::constant(layer);
            let of_picture =
                |library: &mut Self, word: &str, factor: f32| match library.picture(&words, word, Encoding::Linear) {
                    Some(image) => {
                        let mapping = UvMapping::IDENTITY;
                        library.builder.add_texture(Texture::Channel {
                            image,
                            channel: 0,
                            mapping,
                            scale: factor.max(1.0),
                            offset: 0.0,
                        })
                    }
                    None => even(&mut library.builder, factor),
                };
            Material::MetallicRoughness {
                color: diffuse,
                metallic: of_picture(self, "map_pm", metallic),
                roughness: of_picture(self, "map_pr", rough),
                mirrored: self.builder.add_texture(Texture::Curve(curve)),
                edge: even(&mut self.builder, largest.max(if layer > 0.0 { 1.0 } else { 0.0 }).min(1.0)),
                transmission: None,
            }
        };
        let relief = self.relief(&words);
        let id = self.builder.add_material_with(&words.name, material, relief);
        let alpha = match self.picture(&words, "map_d", Encoding::Linear) {
            Some(image) => {
                let channel = if image.has_alpha() { 3 } else { 0 };
                let mapping = UvMapping::IDENTITY;
                Some(self.builder.add_texture(Texture::Channel { image, channel, mapping, scale: opaque, offset: 0.0 }))
            }
            None if opaque < 1.0 => Some(even(&mut self.builder, opaque.max(0.0))),
            None => None,
        };
        if let Some(alpha) = alpha {
            self.builder.set_coverage(id, alpha);
        }
        for word in ["map_ks", "map_ns", "refl"].into_iter().filter(|word| words.pictures.contains_key(*word)) {
            self.builder.note_of("pictures of highlights and surroundings, left out", word);
        }
        if let Some(glow) = color("ke").filter(|glow| glow.iter().any(|v| *v > 0.0)) {
            self.builder.note("a glow of 1 is taken as that of 1 W m⁻² sr⁻¹ nm⁻¹");
            let radiance = SpectralCurve::from_rgb_light(glow);
            self.glows.insert(words.name.clone(), Emission { radiance, is_two_sided: true });
            if let Some(image) = self.picture(&words, "map_ke", Encoding::Srgb) {
                let texture = self.builder.add_texture(laid(&image));
                self.builder.set_glow(id, texture);
            }
        }
        self.materials.insert(words.name.clone(), id);
        Ok(())
    }

    fn relief(&mut self, words: &Words) -> Option<Relief> {
        if let Some(image) = self.picture(words, "norm", Encoding::Linear) {
            return Some(Relief::Normals(self.builder.add_texture(laid(&image))));
        }
        let word = ["map_bump", "bump"].into_iter().find(|word| words.pictures.contains_key(*word))?;
        self.builder.note_of("heights of a unit that isn't said, left out", word);
        None
    }

    fn picture(&mut self, words: &Words, word: &str, encoding: Encoding) -> Option<std::sync::Arc<ImageTexture>> {
        let (path, _) = words.pictures.get(word)?;
        self.builder.add_source(path);
        match ImageTexture::read(path, encoding, Wrap::Repeat) {
            Ok(image) => Some(std::sync::Arc::new(image)),
            Err(error) => {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                if path.is_file() {
                    self.builder.note_of("pictures that can't be read, left out", &error.of_picture(&name));
                } else {
                    self.builder.note_of("pictures that aren't there, left out", &name);
                }
                None
            }
        }
    }
}

fn laid(image: &std::sync::Arc<ImageTexture>) -> Texture {
    Texture::Image { image: image.clone(), mapping: UvMapping::IDENTITY, scale: 1.0 }
}

/// Returns the name of a picture and its strength (`-bm`), after its options.
fn picture_words(text: &str) -> (&str, f32) {
    let (mut rest, mut strength) = (text.trim(), 1.0);
    while let Some(option) = rest.strip_prefix('-') {
        let (name, after) = option.split_once(char::is_whitespace).unwrap_or((option, ""));
        let n_values = match name {
            "o" | "s" | "t" => 3,
            "mm" => 2,
            _ => 1,
        };
        rest = after.trim_start();
        for place in 0..n_values {
            let (value, after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
            // Offsets and scales may have fewer numbers than three.
            if place > 0 && value.parse::<f32>().is_err() {
                break;
            }
            if name == "bm" {
                strength = value.parse().unwrap_or(1.0);
            }
            rest = after.trim_start();
        }
    }
    (rest, strength)
}

/// Returns a file that is named beside another, of Windows' separators too.
fn beside(folder: &Path, name: &str) -> PathBuf {
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
    fn options_of_pictures_are_passed_over() {
        assert_eq!(picture_words("-s 2 2 1 -bm 0.5 my picture.png"), ("my picture.png", 0.5));
        assert_eq!(picture_words("-o 0.1 -clamp on a.png"), ("a.png", 1.0));
        assert_eq!(picture_words("a.png"), ("a.png", 1.0));
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
}
