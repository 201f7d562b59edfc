//! Pages and mosaics show what was computed, with words that name it.

use dioptric_analysis::{
    AnalysisFields, AnalysisFilm, AnalysisRequest, LensDefaults, LensPageData, PsfRequest, PsfSampling,
};
use dioptric_optics::{Glass, Interface, Lens, LensFile, Shape, Surface};
use dioptric_pipeline::Diffraction;
use dioptric_report::{AnalysisPlots, LensPage, psf_mosaic};

fn analysis_request() -> AnalysisRequest {
    AnalysisRequest {
        fields: AnalysisFields::above_axis_deg(&[0.0, 10.0]),
        wavelengths_nm: vec![450.0, 550.0, 650.0],
        main_wavelength_nm: None,
        wavelength_weights: Vec::new(),
        field_weights: Vec::new(),
        distance_mm: f64::INFINITY,
        film: AnalysisFilm::BestFocus,
        n_rings: 6,
    }
}

#[test]
fn analysis_page_names_its_curves() {
    let lens = Lens::built_in("dgauss-50mm").unwrap().with_f_number(4.0, 550.0).unwrap();
    let analysis = analysis_request().compute(&lens).unwrap();
    let plots = AnalysisPlots(&analysis);
    let page = plots.page_svg();
    assert!(page.contains("field curvature") && page.contains("550 nm (reference)") && !page.contains("NaN"));
    assert!(plots.spots_svg().contains("10.0°, 650 nm"));
    let maps = plots.opd_svg();
    assert!(maps.contains("waves late") && maps.contains("λ P–V") && !maps.contains("NaN"));
    assert!(plots.grid_svg().contains("chief rays") && !plots.grid_svg().contains("NaN"));
    let mut used = LensDefaults::of(LensFile::from(lens));
    used.surface_comments = vec!["front & first".to_owned()];
    let shown = LensPageData::of(&analysis_request(), &used, &analysis).unwrap();
    let page = LensPage { plots, shown: &shown, tables: "a < b" };
    let html = page.html().unwrap();
    assert!(html.contains("<pre>a &lt; b</pre>") && html.contains("front &amp; first") && !html.contains("NaN"));
    for part in [
        "Prescription",
        "First order",
        "Modulation over field",
        "Through focus",
        "+0.000 mm",
        "Glasses",
        "Airy",
        "550.0 nm",
    ] {
        assert!(html.contains(part), "{part}");
    }
}

#[test]
fn anamorphic_page_tells_x_from_y() {
    let front = Surface {
        shape: Shape::Biconic { conic: 0.0, curvature_x_per_mm: 1.0 / 30.0, conic_x: 0.0 },
        ..Surface::sphere(100.0, 12.0)
    };
    let row = |surface, medium_after, thickness_after_mm| Interface { surface, medium_after, thickness_after_mm };
    let rows = vec![row(front, Glass::Constant { index: 1.5 }, 3.0), row(Surface::plane(12.0), Glass::Air, 0.0)];
    let lens = Lens::new("anamorphic", "test", rows, 0).unwrap();
    let fields = AnalysisFields::AnglesDeg(vec![[0.0, 0.0], [3.0, 4.0]]);
    let analysis = AnalysisRequest { fields, ..analysis_request() }.compute(&lens).unwrap();
    let plots = AnalysisPlots(&analysis);
    assert!(plots.page_svg().contains("of x, - - of y") && plots.spots_svg().contains("3.0°/4.0°"));
}

#[test]
fn immersed_page_names_heights_and_index() {
    let water = Glass::Constant { index: 1.33 };
    let lens = Lens::thin(5.0, 8.0).unwrap().with_object_medium(water).unwrap();
    let fields = AnalysisFields::HeightsMm(vec![[0.0, 0.0], [0.03, 0.04]]);
    let request = AnalysisRequest { fields, distance_mm: 5.0 * 1.5 * 1.33, ..analysis_request() };
    let analysis = request.compute(&lens).unwrap();
    let plots = AnalysisPlots(&analysis);
    assert!(plots.spots_svg().contains("0.03/0.04 mm") && plots.page_svg().contains("in n = 1.33"));
}

#[test]
fn mosaic_has_a_tile_for_each_picture() {
    let request = PsfRequest {
        fields_deg: vec![[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]],
        distances_mm: vec![4000.0, 8000.0],
        wavelengths_nm: vec![450.0, 550.0, 650.0],
        film: AnalysisFilm::FilmMm(51.8145),
        focus_nm: Vec::new(),
        main_nm: None,
        diffraction: Diffraction::None,
        pixel_um: 2.0,
        size: None,
        sampling: PsfSampling::Pupil,
        mtf_per_mm: vec![],
        seed: 1,
        spectral_weights: vec![],
    };
    let lens = Lens::built_in("paper-2el").unwrap().with_stop_diameter_mm(2.0).unwrap();
    let mosaic = psf_mosaic(&request.compute(&lens).unwrap()).unwrap();
    // Three wavelengths and the light of all of them across, six points down.
    assert!(mosaic.width() > 4 * 160 && mosaic.height() > 6 * 160);
    // A microscope sees nothing at 10°: its tile is dark, and labeled so.
    let film = AnalysisFilm::FocusMm(2000.0);
    let dark = PsfRequest { fields_deg: vec![[0.0, 0.0], [10.0, 0.0]], distances_mm: vec![2000.0], film, ..request };
    assert!(psf_mosaic(&dark.compute(&Lens::built_in("microscope-20x").unwrap()).unwrap()).is_ok());
}
