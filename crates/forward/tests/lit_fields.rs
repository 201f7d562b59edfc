//! A film larger than what a lens sees: models end where the light does, however few fields they have.

use dioptric_forward::{Film, PsfDomain};
use dioptric_optics::{Lens, glam::DVec2};
use dioptric_psf::{Diffraction, FilmMap, GatheredFields, LensImage, LensImageModel, SampleCounts};
use dioptric_spectrum::{Cancel, WavelengthGrid};

#[test]
fn models_of_few_fields_see_as_far_as_those_of_many() {
    let few = SampleCounts { n_radial: 4, n_depths: 2, n_wavelengths: 2, ..SampleCounts::PREVIEW };
    for name in ["dgauss-50mm", "tessar-50mm", "canon-50mm", "cooke-50mm", "dgauss-50mm-schott"] {
        let lens = Lens::built_in(name).unwrap().with_f_number(5.6, 550.0).unwrap();
        let film_distance_mm = lens.at(550.0).unwrap().film_distance_mm_for(960.0).unwrap();
        let (film, grid) = (Film::centered(320, 480, 200.0), WavelengthGrid::uniform(426.0, 674.0, 62.0).unwrap());
        let domain = PsfDomain {
            lens: &lens,
            film: &film,
            film_distance_mm,
            depth_range_m: (0.65, 4.0),
            grid: &grid,
            diffraction: Diffraction::None,
        };
        let settings = domain.settings().unwrap();
        let extents_mm = [few, SampleCounts::PREVIEW, SampleCounts::STANDARD].map(|counts| {
            let model =
                LensImageModel::build_with(&lens, &settings.with_counts(counts), &|_| {}, &Cancel::new()).unwrap();
            assert!(model.is_dark_beyond_extent(), "{name}");
            let FilmMap::Radial(map) = model.film_map(0.7, 550.0, 100.0) else { panic!("{name} has an axis") };
            map.extent_mm()
        });
        println!("{name}: {extents_mm:.3?} mm");
        assert!(extents_mm.iter().all(|mm| (mm / extents_mm[2] - 1.0).abs() < 1e-3), "{name}: {extents_mm:?}");
        // Which is 3 % less than the last field that any ray gets through from; here of the bluest band and the farthest depth, others end up to 2 % before it.
        let mono = [426.0, settings.reference_wavelength_nm].map(|nm| lens.at(nm).unwrap());
        let gathered = GatheredFields::about(DVec2::ZERO, (&mono[0], &mono[1]), 1.0 / 4.0, film_distance_mm).unwrap();
        let lit_tan = 0.8 * gathered.largest_lit_share(0.8 * DVec2::X) / 0.97;
        let last_tan = settings.fields.axes().0.last().copied().unwrap();
        assert!((0.95..0.981).contains(&(last_tan / lit_tan)), "{name}: {last_tan} of {lit_tan}");
    }
}
