//! Ghosts of a lens as a table: what pairs of surfaces send to the film.

use std::{collections::BTreeMap, f64::consts::TAU};

use dioptric_forward::{Film, GhostFilm, GhostSources};
use dioptric_optics::{
    Ghost, GhostLight, GhostRequest, Lens, LightAccount, MOST_BOUNCES, MirrorFilm, MonoLens, ObjectPoint,
    glam::{DVec2, DVec3},
};
use dioptric_pipeline::PipelineError;
use dioptric_spectrum::{Cancel, Quantity, SpectralImage, WavelengthGrid};
use serde::Serialize;

/// What the ghosts of a lens are wanted for.
#[derive(Clone, Debug, PartialEq)]
pub struct GhostTableRequest {
    /// Field angles of the source above the axis, degrees.
    pub fields_deg: Vec<f64>,
    /// Wavelengths, nm.
    pub wavelengths_nm: Vec<f64>,
    /// Distance of the source before the first vertex, mm, or infinite.
    pub distance_mm: f64,
    /// Distance of the film behind the last vertex, mm.
    pub film_distance_mm: f64,
    /// Width and height of the film, mm.
    pub film_mm: [f64; 2],
    /// Rays over the front rim.
    pub n_rays: usize,
    /// How often light is reflected at most: 2, 4 and so on.
    pub bounces: usize,
    /// The share of the light on the film that it reflects, as a mirror does.
    pub film_reflectance: f64,
}

/// The ghosts of a lens.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GhostTable {
    /// The lens.
    pub lens: String,
    /// Distance of the film behind the last vertex, mm.
    pub film_distance_mm: f64,
    /// Width and height of the film, mm.
    pub film_mm: [f64; 2],
    /// Distance of the source before the first vertex, mm; null for a far one.
    pub distance_mm: f64,
    /// Rays over the front rim.
    pub n_rays: usize,
    /// How often light is reflected at most.
    pub bounces: usize,
    /// The share of the light on the film that it reflects.
    pub film_reflectance: f64,
    /// By fields, and for each by wavelengths.
    pub fields: Vec<GhostField>,
    /// All pairs that send light anywhere, with what each does at worst; the brightest first.
    pub pairs: Vec<GhostPair>,
}

/// The ghosts of a source at one field and wavelength.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GhostField {
    /// Above the axis, degrees.
    pub field_deg: f64,
    /// Wavelength, nm.
    pub wavelength_nm: f64,
    /// The image.
    pub image: Landing,
    /// The light of all ghosts on the film over that of the image there.
    pub veil: Option<f64>,
    /// What surfaces reflect twice to the place of the image of even light from all sides, over what the lens images there of it: the veiling glare
    /// of a small black spot (ISO 9358); null where the image is beside the film.
    pub veiling_glare: Option<f64>,
    /// Where all of the light goes: by the same rays, by 2,000 where they are more than 30,000.
    pub account: LightAccount,
    /// All ghosts, the brightest first.
    pub ghosts: Vec<GhostRow>,
}

/// Light on the film.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Landing {
    /// Over the light that falls on the circle of the first surface's rim.
    pub power: f64,
    /// The same of what falls on the film.
    pub power_on_film: f64,
    /// The centroid, mm from the middle of the film, picture frame (x right, y up).
    pub x_mm: f64,
    /// Its height.
    pub y_mm: f64,
    /// The rms distance from it, mm.
    pub rms_radius_mm: f64,
}

/// A ghost at one field and wavelength.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GhostRow {
    /// The surface that reflects first, counted from 0; the film is the one behind the last.
    pub first: usize,
    /// The one before it that reflects then.
    pub second: usize,
    /// Those that reflect after these two; left out where none does.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub then: Vec<usize>,
    /// Where it lands.
    #[serde(flatten)]
    pub landing: Landing,
    /// Its light over the image's.
    pub relative_power: f64,
    /// Its mean irradiance, 1/mm², for an image of light 1: that of an even disc of its rms radius.
    pub relative_irradiance_per_mm2: f64,
    /// How many times as far from the axis as the image its middle lies, by first-order optics.
    pub magnification: f64,
}

/// A pair of surfaces, or a longer way, at its worst.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GhostPair {
    /// The surface that reflects first, counted from 0.
    pub first: usize,
    /// The one before it that reflects then.
    pub second: usize,
    /// Those that reflect after these two; left out where none does.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub then: Vec<usize>,
    /// Its light over the image's, where that is most.
    pub relative_power: f64,
    /// That field, degrees above the axis.
    pub worst_field_deg: f64,
    /// That wavelength, nm.
    pub worst_wavelength_nm: f64,
}

impl GhostTableRequest {
    /// Returns the ghosts of a lens.
    ///
    /// # Errors
    /// When a number makes no sense, a glass or coating is not known at a wavelength, or the lens is one whose ghosts are not followed.
    pub fn compute(&self, lens: &Lens) -> Result<GhostTable, PipelineError> {
        self.check()?;
        let mut fields = Vec::new();
        let mut worst: BTreeMap<Vec<usize>, GhostPair> = BTreeMap::new();
        for &wavelength_nm in &self.wavelengths_nm {
            let mono = lens.at(wavelength_nm)?;
            for &field_deg in &self.fields_deg {
                let field = self.field(&mono, field_deg)?;
                for row in &field.ghosts {
                    let here = GhostPair {
                        first: row.first,
                        second: row.second,
                        then: row.then.clone(),
                        relative_power: row.relative_power,
                        worst_field_deg: field_deg,
                        worst_wavelength_nm: wavelength_nm,
                    };
                    let way = [&[row.first, row.second], row.then.as_slice()].concat();
                    if worst.get(&way).is_none_or(|pair| pair.relative_power < here.relative_power) {
                        worst.insert(way, here);
                    }
                }
                fields.push(field);
            }
        }
        fields.sort_by(|a, b| a.field_deg.total_cmp(&b.field_deg).then(a.wavelength_nm.total_cmp(&b.wavelength_nm)));
        let mut pairs: Vec<GhostPair> = worst.into_values().collect();
        pairs.sort_by(|a, b| b.relative_power.total_cmp(&a.relative_power));
        let Self { distance_mm, film_distance_mm, film_mm, n_rays, bounces, film_reflectance, .. } = *self;
        let lens = lens.name().to_owned();
        Ok(GhostTable {
            lens,
            film_distance_mm,
            film_mm,
            distance_mm,
            n_rays,
            bounces,
            film_reflectance,
            fields,
            pairs,
        })
    }

    /// Returns a picture of all ghosts of the source that two surfaces reflect, whose image is left out: spectral irradiance on a film of so many columns, W m⁻² nm⁻¹, for a far
    /// source that brings 1 W m⁻² nm⁻¹ to a surface facing it, or a near one of 1 W sr⁻¹ nm⁻¹.
    ///
    /// # Errors
    /// As [`compute`](Self::compute), and when there is more than one field.
    pub fn picture(&self, lens: &Lens, columns: usize) -> Result<SpectralImage, PipelineError> {
        self.check()?;
        let [field_deg] = self.fields_deg[..] else {
            let (origin, found) = ("the picture of ghosts".to_owned(), format!("{} fields", self.fields_deg.len()));
            return Err(PipelineError::Value { origin, key: "fields_deg", found, expected: "one".to_owned() });
        };
        let grid = WavelengthGrid::new(self.wavelengths_nm.clone())?;
        let [width_mm, height_mm] = self.film_mm;
        let rows = ((columns as f64 * height_mm / width_mm).round() as usize).max(1);
        let film = Film::centered(rows, columns, 1e3 * width_mm / columns as f64);
        let tan = field_deg.to_radians().tan();
        let mut planes = Vec::new();
        for (band, &wavelength_nm) in self.wavelengths_nm.iter().enumerate() {
            let lens = lens.at(wavelength_nm)?;
            let depth_m = 1e-3 * (self.distance_mm + lens.projection_center_z_mm());
            let source = GhostSources::of_point(DVec2::new(0.0, tan), depth_m, grid.len(), self.n_rays);
            let mirror = film.as_mirror(self.film_distance_mm, self.film_reflectance);
            let on = GhostFilm { lens: &lens, mirror, film };
            planes.push(source.irradiance(band, &on, &Cancel::new())?);
        }
        Ok(SpectralImage::new(Quantity::Irradiance, grid, planes)?.with_pitch_um(film.pitch_um))
    }

    fn check(&self) -> Result<(), PipelineError> {
        let wrong = |key: &'static str, found: String, expected: &str| {
            let (origin, expected) = ("the ghosts".to_owned(), expected.to_owned());
            Err(PipelineError::Value { origin, key, found, expected })
        };
        if let Some(field_deg) = self.fields_deg.iter().find(|deg| deg.is_nan() || deg.abs() >= 90.0) {
            return wrong("fields_deg", field_deg.to_string(), "angles between -90 and 90 degrees");
        }
        if self.distance_mm.is_nan() || self.distance_mm <= 0.0 {
            return wrong("distance_mm", self.distance_mm.to_string(), "a number above 0, or inf");
        }
        if !self.film_mm.iter().all(|mm| *mm > 0.0 && mm.is_finite()) {
            return wrong("film_size_mm", format!("{:?}", self.film_mm), "a width and a height above 0");
        }
        if !(2..=MOST_BOUNCES).contains(&self.bounces) || self.bounces % 2 == 1 {
            return wrong("bounces", self.bounces.to_string(), &format!("an even number from 2 to {MOST_BOUNCES}"));
        }
        if !(0.0..=1.0).contains(&self.film_reflectance) {
            return wrong("film_reflectance", self.film_reflectance.to_string(), "0 to 1");
        }
        if !(1..=MOST_RAYS).contains(&self.n_rays) {
            return wrong("n_rays", self.n_rays.to_string(), "1 to 100000000");
        }
        Ok(())
    }

    fn field(&self, mono: &MonoLens, field_deg: f64) -> Result<GhostField, PipelineError> {
        let field = field_deg.to_radians();
        let point = match self.distance_mm.is_finite() {
            false => ObjectPoint::far(field, DVec2::Y),
            true => {
                let pupil_z_mm = mono.projection_center_z_mm();
                ObjectPoint::Finite(DVec3::new(0.0, field.tan() * (self.distance_mm + pupil_z_mm), -self.distance_mm))
            }
        };
        let request = GhostRequest {
            point,
            film_distance_mm: self.film_distance_mm,
            n_rays: self.n_rays,
            rim_z_mm: mono.front_rim_z_mm(),
            film_half_mm: Some(0.5 * DVec2::from_array(self.film_mm)),
            film_reflectance: self.film_reflectance,
            most_bounces: self.bounces,
        };
        let found = mono.ghosts(&request)?;
        let account_rays = if self.n_rays > ACCOUNT_RAYS { FEW_RAYS } else { self.n_rays };
        let film = MirrorFilm {
            distance_mm: self.film_distance_mm,
            reflectance: self.film_reflectance,
            half_mm: 0.5 * DVec2::from_array(self.film_mm),
            center_mm: DVec2::ZERO,
        };
        let veiling_glare = match found.direct.power_on_film > 0.0 {
            true => mono.veiling_glare(found.direct.centroid_mm, &film, self.n_rays.min(GLARE_RAYS))?,
            false => None,
        };
        let row = |ghost: &Ghost| {
            let landing = Landing::of(&ghost.light);
            let relative_power = ghost.light.power / found.direct.power;
            let area_mm2 = TAU * ghost.light.rms_radius_mm.powi(2);
            GhostRow {
                first: ghost.first,
                second: ghost.second,
                then: ghost.then.clone(),
                landing,
                relative_power,
                relative_irradiance_per_mm2: relative_power / area_mm2,
                magnification: ghost.magnification,
            }
        };
        Ok(GhostField {
            field_deg,
            wavelength_nm: mono.wavelength_nm(),
            image: Landing::of(&found.direct),
            veil: Some(found.veil()).filter(|veil| veil.is_finite()),
            veiling_glare,
            account: mono.light_account(&GhostRequest { n_rays: account_rays, ..request })?,
            ghosts: found.pairs.iter().map(row).collect(),
        })
    }
}

/// The most rays of an account, which takes twice as long as all pairs; for more a share of them does.
const ACCOUNT_RAYS: usize = 30_000;
const FEW_RAYS: usize = 2000;
/// The most rays from a place of the film: good to 1 % of the glare.
const GLARE_RAYS: usize = 5000;
/// The largest number of rays.
const MOST_RAYS: usize = 100_000_000;

impl Landing {
    /// The picture is the film turned by 180°.
    fn of(light: &GhostLight) -> Self {
        // So that there are no zeros below zero.
        let [x_mm, y_mm] = (-light.centroid_mm).to_array().map(|mm| mm + 0.0);
        let GhostLight { power, power_on_film, rms_radius_mm, .. } = *light;
        Self { power, power_on_film, x_mm, y_mm, rms_radius_mm }
    }
}
