//! The lens: read, its stop set, moved before the film.

use std::sync::OnceLock;

use dioptric_optics::{Lens, MonoLens};
use dioptric_sensor::{Layer, Sensor};
use dioptric_spectrum::{Spectrum, WavelengthGrid};

use super::spec::LensInputs;
use crate::{PipelineError, PsfFile, reference_nm_of, with_blades};

/// A lens ready for use.
#[derive(Clone, Debug)]
pub struct ResolvedLens {
    /// The lens, its stop set and its movements applied.
    pub lens: Lens,
    /// The lens at the reference wavelength.
    pub reference: MonoLens,
    /// What its file states and this program does otherwise or not at all, a sentence each.
    pub notes: Vec<String>,
    /// The point spread functions that take the place of its own.
    pub psfs: Option<PsfFile>,
    /// The distance of the object that it is made for, mm from the first vertex.
    object_distance_mm: f64,
    /// Where its file has the film, mm behind the last vertex.
    film_distance_mm: Option<f64>,
    /// What of the light on its axis it lets through, found once.
    transmittance: OnceLock<Option<Layer>>,
}

/// The wavelengths at which the transmittance of a lens is tabulated, nm: where sensors see, in steps between which that of usual coatings
/// is straight to 1e-4.
const TRANSMITTANCE_NM: (f64, f64, f64) = (360.0, 830.0, 10.0);

impl ResolvedLens {
    /// Returns a sensor whose colors are calibrated with this lens, as those of a camera and its lens are: what is white before the lens
    /// is white in its pictures. One that states another calibration keeps it.
    pub(super) fn calibrated(&self, sensor: Sensor) -> Sensor {
        match sensor.calibrated_behind {
            Some(_) => sensor,
            None => Sensor { calibrated_behind: self.transmittance().cloned(), ..sensor },
        }
    }

    /// Returns what of the light on the axis gets through, at the wavelengths at which the lens is known; `None` where it loses none, or
    /// no light comes along the axis.
    pub(super) fn transmittance(&self) -> Option<&Layer> {
        let tabulate = || {
            if self.lens.is_lossless() {
                return None;
            }
            let (first_nm, last_nm, step_nm) = TRANSMITTANCE_NM;
            let wavelengths_nm = (0..=((last_nm - first_nm) / step_nm) as usize).map(|i| first_nm + step_nm * i as f64);
            let known = wavelengths_nm.filter_map(|nm| {
                let lens = self.lens.at(nm).ok()?;
                Some((nm, lens.axial_transmission(self.object_distance_mm)?))
            });
            let (wavelengths_nm, shares): (Vec<f64>, Vec<f64>) = known.unzip();
            let are_all = |known: f64| shares.iter().all(|share| *share == known);
            if are_all(1.0) || are_all(0.0) {
                return None;
            }
            let transmittance = Spectrum::new(wavelengths_nm, shares).ok()?;
            Some(Layer { name: self.lens.name().to_owned(), transmittance })
        };
        self.transmittance.get_or_init(tabulate).as_ref()
    }

    /// Says that a film is not where the file of the lens has it, if that is so.
    pub(super) fn note_on_film(&self, film_distance_mm: f64) -> Option<String> {
        let own_mm = self.film_distance_mm.filter(|own_mm| *own_mm != 0.0)?;
        let is_other = (own_mm - film_distance_mm).abs() > 1e-6 * own_mm.abs();
        is_other.then(|| {
            format!(
                "the film is at {film_distance_mm:.4} mm, where the scene is in focus, not at {own_mm} mm as the lens's file has it: \
                 --film-mm {own_mm} puts it there"
            )
        })
    }

    /// What is to be known of it at these wavelengths, a sentence each: its [`notes`](Self::notes), and which glasses are continued beyond
    /// the range in which they are known.
    pub fn notes_at(&self, wavelengths_nm: &[f64]) -> Vec<String> {
        self.notes.iter().cloned().chain(self.lens.notes_on_ranges(wavelengths_nm)).collect()
    }
}

pub(super) fn resolve(inputs: &LensInputs) -> Result<ResolvedLens, PipelineError> {
    let file = match inputs.given.as_deref() {
        Some(file) => file.clone(),
        None => inputs.choice.open(&inputs.reading)?,
    };
    let reference_nm = reference_nm_of(&file);
    let note_on_stop = inputs.stop.note_at(&file.lens, reference_nm);
    let lens = inputs.stop.apply_at(with_blades(file.lens, inputs.iris)?, reference_nm)?;
    let note_on_iris = lens.note_on_iris();
    let lens = inputs.movements.apply_at(lens, reference_nm)?;
    let reference = lens.at(reference_nm)?;
    // What limits the light is that of the lens's own object.
    let psfs = inputs.psfs.as_deref().map(PsfFile::read).transpose()?;
    let object_distance_mm = file.object_distance_mm.unwrap_or(f64::INFINITY);
    let of_axis = [reference.note_on_limit(object_distance_mm), reference.note_on_bent_axis()];
    let own = file.notes.into_iter().chain(note_on_stop).chain(note_on_iris);
    let notes = own.chain(of_axis.into_iter().flatten()).collect();
    let film_distance_mm = file.film_distance_mm;
    Ok(ResolvedLens {
        lens,
        reference,
        notes,
        psfs,
        object_distance_mm,
        film_distance_mm,
        transmittance: OnceLock::new(),
    })
}

/// Checks that every medium of the lens, and its point spread functions of a file, are known at bands that are known before the scene is.
pub(super) fn check_glasses(lens: &ResolvedLens, grid: Option<&WavelengthGrid>) -> Result<(), PipelineError> {
    for &wavelength_nm in grid.iter().flat_map(|grid| grid.centers_nm()) {
        lens.lens.at(wavelength_nm)?;
        lens.psfs.as_ref().map_or(Ok(()), |psfs| psfs.array.check_at(wavelength_nm))?;
    }
    Ok(())
}
