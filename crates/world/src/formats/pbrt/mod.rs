//! Worlds of pbrt files, versions 2 to 4.
//!
//! A file that says `WorldEnd` is of version 3 or before, else of version 4; one that names a `SurfaceIntegrator` or
//! `Renderer` is of version 2.

mod camera;
mod curves;
mod lights;
mod materials;
mod media;
mod params;
mod shapes;
mod spectra;
mod substances;
mod surfaces;
mod textures;
mod tokens;

use std::{
    collections::HashMap,
    io::Read,
    path::{Path, PathBuf},
    sync::Arc,
};

use dioptric_spectrum::Cancel;
use glam::{DAffine3, DMat4, DVec3};

pub(crate) use self::spectra::photopic_mean;
use self::{
    camera::CameraWords,
    params::Params,
    tokens::{Token, Tokens},
};
use super::read_bytes;
use crate::{
    GroupId, Material, MaterialId, MediumId, Shape, SpectralCurve, Texture, TextureId, TriangleMesh, WorldBuilder,
    WorldError,
};

/// The most bytes that a file and all that it includes may have.
const MAX_BYTES: u64 = 1 << 31;
/// Words of films and cameras that change nothing here: names of files, their storage, and times of a still picture; bands and a
/// sensor are chosen where a world is rendered.
const NO_MATTER: &str = "\
    filename savefp16 display nbuckets lambdamin lambdamax sensor iso scale imagingratio maxcomponentvalue hither \
    yon shutteropen shutterclose";
/// Kinds of what computes a picture, and their parameters, of all versions.
const OF_RENDERERS: &str = "\
    02sequence B C adaptive aggregatetest alpha bdpt bestcandidate bidirectional bootstrapsamples box bvh \
    causticphotons chains createprobes diffuseprt dimensions dipolesubsurface directsamples dodirectseparately \
    emission emptybonus exphotonmap finalgather finalgathersamples gatherangle gaussian gdist glossyprt grid halton \
    igi imagewritefrequency independent indirectdepth indirectphotons intersectcost irradiancecache iterations \
    jitter kdtree lanczossinc largestepprobability lightpath lightsampler lightsamplestrategy lowdiscrepancy \
    maxconsecutiverejects maxdepth maxdist maxerror maxmindist maxnodeprims maxphotondepth maxpixeldist maxprims \
    maxsamples maxspeculardepth metadata method metropolis minpixeldist minsamples minweightangle mitchell mlt \
    mutationsperpixel none nsamples nsets numCABands numcabands numiterations nused paddedsobol path photonmap \
    photonsperiteration pixelbounds pixelsamples pmj02bn quickrender radius random randomization randomwalk \
    refineimmediately regularize rrthreshold sample samplebsdf samplelights sampler samplesperpixel scramble seed \
    sigma simplepath simplevolpath sinc single sobol spectralpath spectralvolpath splitmethod sppm stepsize strategy \
    stratified surfacepoints tau traversalcost triangle useprobes visualizeobjectids visualizestrategies \
    visualizeweights volpath volumephotons xradius xsamples xwidth yradius ysamples ywidth zsobol";
/// Options that change nothing here.
const OPTIONS: &str = "\
    disablepixeljitter disabletexturefiltering disablewavelengthjitter displacementedgescale fullscreen gpu \
    msereferenceimage msereferenceout pixelstats rendercoordsys seed wavefront";
/// How deep files may include each other, and attributes be nested.
const MAX_DEPTH: usize = 32;

/// Reads a file and all that it includes.
pub(super) fn read(path: &Path, metres_per_unit: f64, cancel: &Cancel) -> Result<WorldBuilder, WorldError> {
    let mut reader = Reader::new(path, metres_per_unit, cancel);
    reader.read_file(path, 0)?;
    reader.end_curves();
    reader.set_medium_of_eye();
    Ok(reader.builder)
}

/// What is wrong in the line being read, or in another file.
enum Fault {
    Here(String),
    Elsewhere(WorldError),
}

impl From<String> for Fault {
    fn from(reason: String) -> Self {
        Self::Here(reason)
    }
}

impl From<WorldError> for Fault {
    fn from(error: WorldError) -> Self {
        Self::Elsewhere(error)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Version {
    Two,
    Three,
    Four,
}

/// What holds for the shapes that follow.
#[derive(Clone, Debug)]
struct Attributes {
    /// File units from object units.
    place: DAffine3,
    material: MaterialId,
    glow: Option<lights::Glow>,
    is_reversed: bool,
    /// The media that fill shapes, and that are around them.
    inside: String,
    /// What a comment of ISET's calls the shapes, and the name of their material.
    name: Option<Arc<str>>,
    material_name: Option<Arc<str>>,
    outside: String,
}

struct Reader<'c> {
    builder: WorldBuilder,
    metres_per_unit: f64,
    folder: PathBuf,
    version: Version,
    bytes_left: u64,
    attributes: Attributes,
    saved: Vec<Attributes>,
    places: HashMap<String, DAffine3>,
    camera: CameraWords,
    is_in_world: bool,
    materials: HashMap<String, MaterialId>,
    spectrum_textures: HashMap<String, TextureId>,
    number_textures: HashMap<String, TextureId>,
    /// Curves of names, so that each is tabulated once.
    named_curves: HashMap<String, SpectralCurve>,
    objects: HashMap<String, GroupId>,
    object: Option<GroupId>,
    /// Materials of which a part is there, by the bits of a number or the number of a texture.
    covered: HashMap<(MaterialId, Coverage), MaterialId>,
    /// Media by their names; none where it is left out.
    media: HashMap<String, Option<MediumId>>,
    /// Where the camera is, in units of the file, and the name of the medium around it.
    eye: Option<(DVec3, String)>,
    /// Curves of one material and place, which are one mesh.
    curves: Option<(Attributes, MaterialId, TriangleMesh)>,
    cancel: &'c Cancel,
}

/// How much of a shape is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Coverage {
    Number(u32),
    Texture(TextureId),
}

impl<'c> Reader<'c> {
    fn new(path: &Path, metres_per_unit: f64, cancel: &'c Cancel) -> Self {
        let mut builder = WorldBuilder::new();
        builder.set_up(DVec3::Y, true);
        let half = builder.add_texture(Texture::Curve(SpectralCurve::constant(0.5)));
        let material = builder.add_material("default", Material::Matte { reflectance: half });
        let attributes = Attributes {
            place: DAffine3::IDENTITY,
            material,
            glow: None,
            is_reversed: false,
            inside: String::new(),
            name: None,
            material_name: None,
            outside: String::new(),
        };
        Self {
            builder,
            metres_per_unit,
            folder: path.parent().unwrap_or(Path::new("")).to_owned(),
            version: Version::Four,
            bytes_left: MAX_BYTES,
            attributes,
            saved: Vec::new(),
            places: HashMap::new(),
            camera: CameraWords::default(),
            is_in_world: false,
            materials: HashMap::new(),
            spectrum_textures: HashMap::new(),
            number_textures: HashMap::new(),
            named_curves: HashMap::new(),
            objects: HashMap::new(),
            object: None,
            covered: HashMap::new(),
            media: HashMap::new(),
            eye: None,
            curves: None,
            cancel,
        }
    }

    fn read_file(&mut self, path: &Path, depth: usize) -> Result<(), WorldError> {
        self.builder.add_source(path);
        let bytes = unpacked(path, read_bytes(path, self.bytes_left)?, self.bytes_left)?;
        self.bytes_left -= bytes.len() as u64;
        // Names and comments may be in any old encoding.
        let text = dioptric_files::text::of_bytes(&bytes);
        if depth == 0 && text.contains("WorldEnd") {
            self.version = Version::Three;
        }
        let mut tokens = Tokens::new(&text);
        loop {
            self.cancel.check()?;
            let at = |line: usize, reason: String| WorldError::Line { file: path.to_owned(), line, reason };
            let next = tokens.next().map_err(|reason| at(tokens.line(), reason))?;
            if let Some(name) = tokens.take_object_name() {
                self.attributes.name = Some(name.into());
            }
            let Some((token, line)) = next else { return Ok(()) };
            let done = match token {
                Token::Word(directive) => self.directive(directive, &mut tokens, depth),
                other => Err(Fault::Here(format!("expected a directive such as Shape, found {other:?}"))),
            };
            done.map_err(|fault| match fault {
                Fault::Here(reason) => at(line, reason),
                Fault::Elsewhere(error) => error,
            })?;
        }
    }

    fn directive(&mut self, directive: &str, tokens: &mut Tokens<'_>, depth: usize) -> Result<(), Fault> {
        if directive != "Shape" {
            self.end_curves();
        }
        match directive {
            "Include" | "Import" => return self.include(text(directive, tokens)?, depth),
            "WorldBegin" => self.begin_world()?,
            "WorldEnd" => {}
            "AttributeBegin" | "TransformBegin" => self.save()?,
            "AttributeEnd" => self.attributes = self.saved.pop().ok_or_else(|| no_begin(directive))?,
            "TransformEnd" => self.attributes.place = self.saved.pop().ok_or_else(|| no_begin(directive))?.place,
            "ReverseOrientation" => self.attributes.is_reversed ^= true,
            "Identity" | "Translate" | "Scale" | "Rotate" | "LookAt" | "Transform" | "ConcatTransform" => {
                self.transform(directive, tokens)?;
            }
            "CoordinateSystem" => {
                let name = text(directive, tokens)?.to_owned();
                self.places.insert(name, self.attributes.place);
            }
            "CoordSysTransform" => {
                let name = text(directive, tokens)?;
                match self.places.get(name) {
                    Some(place) => self.attributes.place = *place,
                    None => {
                        self.builder.note_of("CoordSysTransform: no such coordinate system, nothing is moved", name)
                    }
                }
            }
            "ActiveTransform" => {
                if !matches!(tokens.next()?, Some((Token::Word(_), _))) {
                    return Err("ActiveTransform: expected All, StartTime or EndTime".to_owned().into());
                }
                self.builder.note("ActiveTransform: motion isn't followed; later transforms hold for all times");
            }
            "TransformTimes" => {
                numbers::<2>(directive, tokens)?;
            }
            "ObjectBegin" => {
                let name = text(directive, tokens)?.to_owned();
                if self.object.is_some() {
                    return Err("ObjectBegin within an object".to_owned().into());
                }
                self.save()?;
                let group = self.builder.add_group();
                self.object = Some(group);
                self.objects.insert(name, group);
            }
            "ObjectEnd" => {
                self.object.take().ok_or_else(|| no_begin(directive))?;
                self.attributes = self.saved.pop().ok_or_else(|| no_begin(directive))?;
            }
            "ObjectInstance" => {
                let name = text(directive, tokens)?;
                let Some(&group) = self.objects.get(name) else {
                    self.builder.note_of("ObjectInstance: no such object, left out", name);
                    return Ok(());
                };
                if self.object.is_some() {
                    return Err("ObjectInstance within an object".to_owned().into());
                }
                // Shapes of the object are in metres already.
                let to_metres = DAffine3::from_scale(DVec3::splat(self.metres_per_unit));
                let place = to_metres * self.checked_place()? * to_metres.inverse();
                self.builder.name_next(name);
                self.builder.add_instance(group, place);
            }
            "Texture" => return self.texture(tokens),
            "NamedMaterial" => {
                let name = text(directive, tokens)?;
                match self.materials.get(name) {
                    Some(material) => {
                        self.attributes.material = *material;
                        self.attributes.material_name = Some(name.into());
                    }
                    None => self.builder.note_of("NamedMaterial: no such material, the one before it stands", name),
                }
            }
            _ => return self.directive_with_params(directive, tokens),
        }
        Ok(())
    }

    /// Reads the directives of the form `Directive "kind" parameters`.
    fn directive_with_params(&mut self, directive: &str, tokens: &mut Tokens<'_>) -> Result<(), Fault> {
        match directive {
            "Camera" | "Film" | "Shape" | "LightSource" | "AreaLightSource" | "Material" | "MakeNamedMaterial"
            | "Sampler" | "PixelFilter" | "Integrator" | "Accelerator" | "ColorSpace" | "MakeNamedMedium"
            | "Attribute" | "SurfaceIntegrator" | "VolumeIntegrator" | "Renderer" | "Volume" => {}
            "MediumInterface" => {
                let mut names = Vec::new();
                while let Some(Token::Text(name)) = tokens.peek()? {
                    tokens.next()?;
                    names.push(name);
                }
                self.medium_interface(&names);
                return Ok(());
            }
            "Option" => {
                let unknown = Params::read(tokens)?.unused().into_iter().filter(|name| !has_word(OPTIONS, name));
                unknown.for_each(|name| self.builder.note_of("options that aren't supported, left out", name));
                return Ok(());
            }
            _ => return Err(format!("'{directive}' is no directive of pbrt").into()),
        }
        let kind = text(directive, tokens)?;
        let params = Params::read(tokens)?;
        match directive {
            "Camera" => {
                self.camera.set_camera(kind, &params, self.attributes.place);
                let world_from_camera = self.attributes.place.inverse();
                self.places.insert("camera".to_owned(), world_from_camera);
                if world_from_camera.is_finite() {
                    self.eye = Some((world_from_camera.translation, self.attributes.outside.clone()));
                }
            }
            "Film" => {
                if !matches!(kind, "rgb" | "gbuffer" | "spectral" | "image") {
                    self.builder.note_of("films of a kind that isn't known, as an image", kind);
                }
                if self.camera.set_film(&params) {
                    self.builder
                        .note(format!("Film \"{kind}\": a part of the picture is asked for; all of it is the picture"));
                }
            }
            "Shape" => self.shape(kind, &params)?,
            "LightSource" => self.light(kind, &params)?,
            "AreaLightSource" => self.attributes.glow = Some(self.glow(kind, &params)?),
            "Material" => {
                let material = self.material(kind, kind, &params)?;
                self.attributes.material = material;
                self.attributes.material_name = None;
            }
            "MakeNamedMaterial" => {
                let of_kind = params.text("type").unwrap_or("matte");
                let material = self.material(kind, of_kind, &params)?;
                self.materials.insert(kind.to_owned(), material);
            }
            "ColorSpace" if kind != "srgb" => {
                self.builder.note(format!("ColorSpace \"{kind}\": colors are taken as sRGB"));
            }
            "MakeNamedMedium" if !self.named_medium(kind, &params)? => return Ok(()),
            "Volume" | "Attribute" => {
                self.builder.note_of(&format!("{directive}: not supported, left out"), kind);
                return Ok(());
            }
            "Sampler" | "PixelFilter" | "Integrator" | "Accelerator" | "SurfaceIntegrator" | "VolumeIntegrator"
            | "Renderer" => self.way_of_computing(directive, kind),
            _ => {}
        }
        self.report_unused(directive, kind, &params);
        Ok(())
    }

    /// How a picture is computed is the renderer's affair, unless other light is followed.
    fn way_of_computing(&mut self, directive: &str, kind: &str) {
        if directive.starts_with("Surface") || directive.starts_with("Volume") || directive == "Renderer" {
            self.version = Version::Two;
        }
        if matches!(kind, "directlighting" | "whitted" | "ambientocclusion" | "ao") {
            self.builder.note(format!(
                "{directive} \"{kind}\": light that is scattered more than once is followed too, unless its scatterings are limited"
            ));
        } else if !has_word(OF_RENDERERS, kind) {
            self.builder.note(format!("{directive} \"{kind}\": not known, left out"));
        }
    }

    /// Reports parameters that nobody asked for.
    fn report_unused(&mut self, directive: &str, kind: &str, params: &Params<'_>) {
        let no_matter = match directive {
            "Film" | "Camera" => NO_MATTER,
            "Sampler" | "PixelFilter" | "Integrator" | "Accelerator" | "SurfaceIntegrator" | "VolumeIntegrator"
            | "Renderer" => OF_RENDERERS,
            _ => "",
        };
        let is_told = |name: &&str| !has_word(no_matter, name);
        let unused: Vec<&str> = params.unused().into_iter().filter(is_told).collect();
        if !unused.is_empty() {
            let unused = unused.join(", ");
            self.builder.note(format!("{directive} \"{kind}\": not supported and left out: {unused}"));
        }
    }

    /// Adds the curves so far.
    fn end_curves(&mut self) {
        let Some((attributes, material, mesh)) = self.curves.take() else { return };
        let place = DAffine3::from_scale(DVec3::splat(self.metres_per_unit)) * attributes.place;
        let group = self.object.unwrap_or(GroupId::ROOT);
        let id = self.builder.add_shape_to(group, Shape::Mesh(mesh), place, material, None);
        self.set_interface(id, [&attributes.inside, &attributes.outside]);
    }

    fn include(&mut self, name: &str, depth: usize) -> Result<(), Fault> {
        if depth >= MAX_DEPTH {
            return Err(format!("Include \"{name}\": files include each other deeper than {MAX_DEPTH}").into());
        }
        match self.find_file(name) {
            Some(path) => Ok(self.read_file(&path, depth + 1)?),
            None => {
                self.builder.note_of("Include: no such file, left out", name);
                Ok(())
            }
        }
    }

    /// Returns a file that is named in the world's, beside which it is looked for; of Windows' separators either way.
    fn find_file(&mut self, name: &str) -> Option<PathBuf> {
        let path = self.folder.join(name);
        let path = if path.is_file() { path } else { self.folder.join(name.replace('\\', "/")) };
        self.builder.add_source(&path);
        path.is_file().then_some(path)
    }

    fn begin_world(&mut self) -> Result<(), Fault> {
        if self.is_in_world {
            return Err("a second WorldBegin".to_owned().into());
        }
        self.is_in_world = true;
        if let Some(camera) = self.camera.finish(self.metres_per_unit)? {
            self.builder.add_camera(camera);
        }
        self.attributes.place = DAffine3::IDENTITY;
        self.places.insert("world".to_owned(), DAffine3::IDENTITY);
        Ok(())
    }

    fn save(&mut self) -> Result<(), Fault> {
        if self.saved.len() >= 1 << 16 {
            return Err("attributes nested deeper than 65536".to_owned().into());
        }
        self.saved.push(self.attributes.clone());
        Ok(())
    }

    fn transform(&mut self, directive: &str, tokens: &mut Tokens<'_>) -> Result<(), Fault> {
        let place = &mut self.attributes.place;
        match directive {
            "Identity" => *place = DAffine3::IDENTITY,
            "Translate" => *place *= DAffine3::from_translation(DVec3::from_array(numbers(directive, tokens)?)),
            "Scale" => *place *= DAffine3::from_scale(DVec3::from_array(numbers(directive, tokens)?)),
            "Rotate" => {
                let [degrees, x, y, z] = numbers(directive, tokens)?;
                let axis = DVec3::new(x, y, z).try_normalize().ok_or("Rotate: an axis without length".to_owned())?;
                *place *= DAffine3::from_axis_angle(axis, degrees.to_radians());
            }
            "LookAt" => {
                let n: [f64; 9] = numbers(directive, tokens)?;
                *place *= look_at(n).ok_or("LookAt: eye, aim and up don't span a view".to_owned())?;
            }
            _ => {
                let is_open = tokens.peek()? == Some(Token::Open);
                if is_open {
                    tokens.next()?;
                }
                let m = DMat4::from_cols_array(&numbers(directive, tokens)?);
                if is_open && tokens.next()?.map(|(token, _)| token) != Some(Token::Close) {
                    return Err(format!("{directive}: expected 16 numbers in brackets").into());
                }
                let row = m.row(3);
                if row.w == 0.0 {
                    return Err(format!("{directive}: its last row is {row}, expected 0, 0, 0, 1").into());
                }
                if row.truncate() != DVec3::ZERO {
                    self.builder.note(format!("{directive}: its last row, which isn't 0, 0, 0, 1, is left out"));
                }
                let affine = DAffine3::from_mat4(m * (1.0 / row.w));
                let place = &mut self.attributes.place;
                *place = if directive == "Transform" { affine } else { *place * affine };
            }
        }
        Ok(())
    }

    /// The transform of what stands here, once it is sure that it can be undone.
    fn checked_place(&self) -> Result<DAffine3, Fault> {
        let place = self.attributes.place;
        let determinant = place.matrix3.determinant();
        if place.is_finite() && determinant.is_normal() && place.inverse().is_finite() {
            Ok(place)
        } else {
            Err("the current transform flattens what it moves".to_owned().into())
        }
    }

    /// Metres from the units of an object that stands here.
    fn place_m(&self) -> Result<DAffine3, Fault> {
        Ok(DAffine3::from_scale(DVec3::splat(self.metres_per_unit)) * self.checked_place()?)
    }
}

/// Returns the bytes of a file, unpacked where they are those of gzip.
fn unpacked(path: &Path, bytes: Vec<u8>, limit: u64) -> Result<Vec<u8>, WorldError> {
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        return Ok(bytes);
    }
    let unreadable = |reason: String| WorldError::Unreadable { file: path.to_owned(), reason };
    let mut text = Vec::new();
    let mut unpacking = flate2::read::MultiGzDecoder::new(bytes.as_slice()).take(limit + 1);
    unpacking.read_to_end(&mut text).map_err(|e| unreadable(e.to_string()))?;
    if text.len() as u64 > limit {
        return Err(unreadable(format!("it unpacks to more than {limit} bytes")));
    }
    Ok(text)
}

/// Whether a word is one of a list.
fn has_word(list: &str, word: &str) -> bool {
    list.split_ascii_whitespace().any(|known| known == word)
}

fn no_begin(directive: &str) -> String {
    format!("{directive} without its beginning")
}

/// Returns the camera-from-world transform of pbrt's `LookAt`: +z from the eye to the aim, +y as near to up as can be.
fn look_at(n: [f64; 9]) -> Option<DAffine3> {
    let [eye, aim, up] = [0, 3, 6].map(|i| DVec3::new(n[i], n[i + 1], n[i + 2]));
    let z = (aim - eye).try_normalize()?;
    // Left-handed: x to the right as seen along z with y up.
    let x = up.try_normalize()?.cross(z).try_normalize()?;
    let world_from_camera = DAffine3::from_cols(x, z.cross(x), z, eye);
    Some(world_from_camera.inverse())
}

fn text<'a>(directive: &str, tokens: &mut Tokens<'a>) -> Result<&'a str, String> {
    match tokens.next()? {
        Some((Token::Text(text), _)) => Ok(text),
        other => Err(format!("{directive}: expected a name in quotes, found {:?}", other.map(|(token, _)| token))),
    }
}

fn numbers<const N: usize>(directive: &str, tokens: &mut Tokens<'_>) -> Result<[f64; N], String> {
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        match tokens.next()? {
            Some((Token::Number(value), _)) => *number = value,
            other => {
                let found = other.map(|(token, _)| token);
                return Err(format!("{directive}: expected {N} numbers, found {found:?}"));
            }
        }
    }
    Ok(numbers)
}
